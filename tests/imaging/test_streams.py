"""Places of frames: no two are the same."""

from irtscots_cl.imaging.streams import EVERYWHERE, SCANS, Stream, place_of


def test_every_frame_has_a_place_of_its_own():
    numbers = (0, 1, 2, 3, 4, 2**16, 2**32 - 1)
    places = {
        place_of(scan, line, exposure, frame)
        for scan in SCANS for line in numbers for exposure in numbers for frame in numbers
    }  # fmt: skip
    assert len(places) == len(SCANS) * len(numbers) ** 3
    assert all(0 <= part < 2**64 for place in places for part in place)


def test_effects_have_streams_of_their_own():
    assert len(set(Stream)) == len(Stream.__members__) == 9
    assert place_of("x", 0) == EVERYWHERE  # of pixels, which have other streams than frames
