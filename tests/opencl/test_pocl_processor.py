"""PoCL gets the name of a processor that its compiler knows."""

import os
from array import array

import pytest

from irtscots_cl.opencl.device import select_device
from irtscots_cl.opencl.pocl_processor import DESCRIPTION_BYTES, MEMORY, best_processor, unknown_name

pytestmark = pytest.mark.skipif(not MEMORY.exists(), reason="PoCL's wheel is for Linux")


@pytest.fixture
def memory():
    file = os.open(MEMORY, os.O_RDONLY)
    yield file
    os.close(file)


def description(triple: bytes, processor: bytes):
    """Memory laid out as a device's description: words that are no addresses, and two pointers to text."""
    texts = [array("B", text.ljust(64, b"\0")) for text in (triple, processor)]
    words = array("Q", [*range(7, 7 + DESCRIPTION_BYTES // 8)])
    words[79], words[80] = (text.buffer_info()[0] for text in texts)
    return words, texts


def test_an_unknown_name_is_found_beside_its_triple(memory):
    words, _texts = description(b"x86_64-unknown-linux-gnu", b"generic")
    address = words.buffer_info()[0]
    assert unknown_name(memory, address) == address + 8 * 80


def test_a_known_name_and_another_text_are_left_alone(memory):
    for triple, processor in ((b"x86_64-unknown-linux-gnu", b"znver3"), (b"something", b"generic")):
        words, _texts = description(triple, processor)
        assert unknown_name(memory, words.buffer_info()[0]) is None


def test_memory_that_cannot_be_read_holds_no_name(memory):
    assert unknown_name(memory, 4096) is None


def test_the_name_needs_every_instruction_set_that_it_stands_for():
    avx2 = "flags\t\t: fpu avx2 fma f16c bmi1 bmi2 movbe"
    assert best_processor(avx2) == b"haswell"
    assert best_processor(avx2 + " avx512f avx512bw avx512cd avx512dq avx512vl") == b"skylake-avx512"
    assert best_processor(avx2.replace("fma ", "")) == b"x86-64"
    assert best_processor("processor : 0") == b"x86-64"


def test_the_selected_device_keeps_no_unknown_name(memory):
    assert unknown_name(memory, select_device().cl_device.int_ptr) is None
