"""Folders with report.json and result.h5, without pictures and pages."""

import dataclasses

from irtscots_cl.pipeline.simulate import simulate
from irtscots_cl.report.result_file import write_result
from irtscots_cl.system.atomic_files import write_json
from tests.support.synthetic import small_scene


def store_run(folder, pixels=25, scale=1.0, orientation="upright"):
    """A run without rays whose deviation is `scale` times that of sphere-deviated; returns the Run."""
    scene = small_scene("sphere-deviated", pixels)
    terms = tuple(
        dataclasses.replace(table, coefficients_um={n: scale * c for n, c in table.coefficients_um.items()})
        for table in scene.mirror.zernike
    )
    detector = dataclasses.replace(scene.camera.detector, orientation=orientation)
    scene = dataclasses.replace(
        scene,
        mirror=dataclasses.replace(scene.mirror, zernike=terms),
        camera=dataclasses.replace(scene.camera, detector=detector),
    )
    run = simulate(scene, estimator="analytic")
    folder.mkdir(parents=True)
    write_result(folder / "result.h5", run.stack, run.result, {}, run.bars)
    write_json(folder / "report.json", run.report)
    return run
