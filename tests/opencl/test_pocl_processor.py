"""PoCL gets the name of a processor that its compiler knows."""

import ctypes

from irtscots_cl.opencl import pocl_processor
from irtscots_cl.opencl.device import select_device
from irtscots_cl.opencl.pocl_processor import best_processor


def description(triple: bytes, processor: bytes):
    """Memory laid out as a device's description: words that are no addresses, and two pointers to text."""
    texts = [ctypes.create_string_buffer(text, 64) for text in (triple, processor)]
    words = (ctypes.c_uint64 * (pocl_processor.DESCRIPTION_BYTES // 8))(*range(7, 40))
    words[79], words[80] = (ctypes.addressof(text) for text in texts)
    return words, texts


def test_an_unknown_name_is_found_beside_its_triple():
    words, texts = description(b"x86_64-unknown-linux-gnu", b"generic")
    address = ctypes.addressof(words)
    assert pocl_processor._unknown_name(address) == address + 8 * 80


def test_a_known_name_and_another_text_are_left_alone():
    for triple, processor in ((b"x86_64-unknown-linux-gnu", b"znver3"), (b"something", b"generic")):
        words, texts = description(triple, processor)
        assert pocl_processor._unknown_name(ctypes.addressof(words)) is None


def test_the_name_needs_every_instruction_set_that_it_stands_for():
    avx2 = "flags\t\t: fpu avx2 fma f16c bmi1 bmi2 movbe"
    assert best_processor(avx2) == b"haswell"
    assert best_processor(avx2 + " avx512f avx512bw avx512cd avx512dq avx512vl") == b"skylake-avx512"
    assert best_processor(avx2.replace("fma ", "")) == b"x86-64"
    assert best_processor("processor : 0") == b"x86-64"


def test_the_selected_device_keeps_no_unknown_name():
    device = select_device()
    assert pocl_processor._unknown_name(device.cl_device.int_ptr) is None
