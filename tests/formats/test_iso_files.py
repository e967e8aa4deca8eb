"""ISO 25178's .sdf and .x3p: made from the formats' descriptions, and the package's own writers."""

import numpy as np
import pytest
from map_files import letter_map_nm, sdf_binary, sdf_text, x3p, zipped

from irtscots_cl.formats.height_map import HeightMap, MapOptions
from irtscots_cl.formats.iso_sdf import read_iso_sdf, write_iso_sdf
from irtscots_cl.formats.iso_x3p import read_iso_x3p, write_iso_x3p

VALUES = np.array([[1.0, 2.0, 3.0], [4.0, -5.0, 6.0]])  # the smallest y first


def read(folder, data, reader, **options):
    path = folder / "a.sdf"
    path.write_bytes(data)
    return reader(path, MapOptions(**options))


def refused(folder, data, reader):
    with pytest.raises(ValueError, match=".") as caught:
        read(folder, data, reader)
    assert str(caught.value).startswith(str(folder / "a.sdf")) and str(caught.value).isprintable()
    return str(caught.value)


@pytest.mark.parametrize(
    "data", [sdf_binary(VALUES), sdf_binary(VALUES, kind=3), sdf_binary(VALUES, kind=6), sdf_text(VALUES)]
)
def test_sdf(tmp_path, data):
    found = read(tmp_path, data, read_iso_sdf)
    np.testing.assert_allclose(found.heights_mm, VALUES * 1e-6, rtol=1e-15)
    assert found.pitch_mm == pytest.approx((0.1, 0.1)) and (found.kind, found.warnings) == ("surface", ())


def test_sdf_invalid_points(tmp_path):
    values = np.where(VALUES == 2, np.nan, VALUES)
    for data in (sdf_text(values), sdf_binary(values), sdf_binary(np.where(VALUES == 2, -(2**31), VALUES), kind=6)):
        assert read(tmp_path, data, read_iso_sdf).valid.tolist() == np.isfinite(values).tolist()
    assert not read(tmp_path, sdf_binary(np.array([[1, -(2**15)]]), kind=5), read_iso_sdf).valid[0, 1]


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (sdf_binary(VALUES)[:-1], "cut off or broken"),
        (sdf_binary(VALUES)[:50], "50 of the 81 bytes of its header"),
        (sdf_binary(VALUES)[:78] + b"\1" + sdf_binary(VALUES)[79:], "compression 1"),
        (sdf_binary(VALUES, z_m=0.0), "Zscale = 0"),
        (sdf_binary(VALUES, z_m=np.inf), "Zscale = inf"),
        (sdf_binary(VALUES, pitch_m=(np.nan, 1.0)), "Xscale = nan"),
        (sdf_text(VALUES)[:-14], "of its 6 values: cut off or broken"),
        (sdf_text(VALUES).replace(b"-5.0", b"-5,0"), "'-5,0': must be a number"),
        (sdf_text(VALUES).replace(b"NumPoints    = 3", b"NumPoints = 60000"), "cut off or broken"),
        (sdf_text(VALUES).replace(b"Zscale ", b"Zskale "), "its header has no zscale"),
        (sdf_text(VALUES).replace(b"Compression  = 0", b"Compression = 1"), "compression 1: must be 0"),
        (b"aISO-1.0\nno header\n", "must be key = value"),
    ],
)
def test_broken_sdf(tmp_path, data, said):
    assert said in refused(tmp_path, data, read_iso_sdf)


@pytest.mark.parametrize("kind", ["D", "F"])
def test_x3p(tmp_path, kind):
    values = np.where(VALUES == 2, np.nan, VALUES) * 1e-9
    found = read(tmp_path, x3p(values, kind=kind, pitch_m=(1e-4, 2e-4)), read_iso_x3p)
    np.testing.assert_allclose(found.heights_mm, values * 1e3, rtol=1e-7 if kind == "F" else 1e-15)
    assert found.pitch_mm == pytest.approx((0.1, 0.2)) and (found.kind, found.warnings) == ("surface", ())


@pytest.mark.parametrize("kind", ["I", "L"])
def test_x3p_whole_numbers_with_scale_offset_and_valid_points(tmp_path, kind):
    found = read(tmp_path, x3p(VALUES, kind=kind, scale=2e-9, offset=1e-9, valid=VALUES != 2), read_iso_x3p)
    np.testing.assert_allclose(found.heights_mm, np.where(VALUES == 2, np.nan, 2 * VALUES + 1) * 1e-6, rtol=1e-12)


def edited(old, new):
    import io
    import zipfile

    with zipfile.ZipFile(io.BytesIO(x3p(VALUES))) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    assert old in files["main.xml"]
    return zipped({**files, "main.xml": files["main.xml"].replace(old, new)})


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (x3p(VALUES)[:-30], "not a readable X3P file"),
        (zipped({"x": b""}), "has no main.xml"),
        (zipped({"main.xml": b"<a><b></a>"}), "not a readable X3P file"),
        (zipped({"main.xml": b"<!DOCTYPE a [<!ENTITY x 'y'>]><a>&x;</a>"}), "no entities of its own"),
        (zipped({"main.xml": b"<a></a>" + b" " * 2**21}), "must have at most"),
        (edited(b"<SizeX>3", b"<SizeX>4"), "48 bytes, of 64: cut off or broken"),
        (edited(b"<SizeX>3", b"<SizeX>9999999"), "cut off or broken"),
        (edited(b"<SizeX>3", b"<SizeX>-3"), "SizeX: -3"),
        (edited(b"<SizeZ>1", b"<SizeZ>2"), "SizeZ = 2"),
        (edited(b"<DataType>D", b"<DataType>Q"), "CZ/DataType = Q"),
        (edited(b"bindata/data.bin", b"../../etc/passwd"), "has no '../../etc/passwd'"),
        (edited(b"<Increment>1.0<", b"<Increment>nan<"), "must be finite"),
        (edited(b"<AxisType>I", b"<AxisType>A"), "AxisType: must be I"),
    ],
)  # fmt: skip
def test_broken_x3p(tmp_path, data, said):
    assert said in refused(tmp_path, data, read_iso_x3p)


@pytest.mark.parametrize(("reader", "writer"), [(read_iso_sdf, write_iso_sdf), (read_iso_x3p, write_iso_x3p)])
def test_written_files_come_back(tmp_path, reader, writer):
    path = tmp_path / "a"
    given = HeightMap(letter_map_nm() * 1e-6, (0.1, 0.2))
    writer(path, given)
    found = reader(path, MapOptions())
    np.testing.assert_allclose(found.heights_mm, given.heights_mm, rtol=3e-16)
    assert found.pitch_mm == pytest.approx(given.pitch_mm, rel=1e-15)
    assert "half its height" in " ".join(writer(path, HeightMap(given.heights_mm, (0.1, 0.2), kind="wavefront")))
    np.testing.assert_allclose(reader(path, MapOptions()).heights_mm, given.heights_mm / 2, rtol=3e-16)
    with pytest.raises(ValueError, match="needs a lateral scale"):
        writer(path, HeightMap(given.heights_mm))
