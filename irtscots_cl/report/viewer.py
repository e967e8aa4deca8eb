"""A result's page as a widget of notebooks, where anywidget is installed."""

from __future__ import annotations

from typing import Any

from irtscots_cl.analysis.comparison import Comparison
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.report.page.page import page_of

HEIGHT_PX = 760
# The page runs in a frame of its own, which can reach neither the notebook nor the network's cookies, and tells of
# chosen pixels by messages.
MODULE = """
export default {
  render({ model, el }) {
    const frame = document.createElement("iframe");
    frame.title = "maps of the measured mirror";
    frame.sandbox = "allow-scripts";
    frame.style.cssText = `width: 100%; height: ${model.get("height_px")}px; border: 0`;
    frame.srcdoc = model.get("page");
    const take = (event) => {
      if (event.source !== frame.contentWindow || !Array.isArray(event.data.chosen)) return;
      model.set("chosen", event.data.chosen);
      model.save_changes();
    };
    window.addEventListener("message", take);
    el.append(frame);
    return () => window.removeEventListener("message", take);
  },
};
"""


def viewer(
    result: Reconstruction,
    comparison: Comparison | None = None,
    stack: ImageStack | None = None,
    height_px: int = HEIGHT_PX,
) -> Any:
    """A widget with the maps of report.html; its trait `chosen` is the [row, column] of the pixel clicked last.

    comparison: adds the map of the error. stack: adds the light curves and the camera's frames. Raises ImportError
    without anywidget.
    """
    try:
        import anywidget
        import traitlets
    except ImportError:
        raise ImportError("viewer needs anywidget: pip install 'irtscots-cl[notebook]'") from None

    traits = {
        "page": traitlets.Unicode().tag(sync=True),
        "height_px": traitlets.Int().tag(sync=True),
        "chosen": traitlets.List(trait=traitlets.Int()).tag(sync=True),
    }
    kind: Any = type("Viewer", (anywidget.AnyWidget,), {"_esm": MODULE, **traits})
    return kind(page=page_of(result, comparison, stack), height_px=height_px)
