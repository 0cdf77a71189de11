"""Additions to viser's page: a loading message, names for screen readers, and an overlay."""

import html
from pathlib import Path

from timsim.page._plots import plots_script, plots_style


def with_additions(page: bytes, name: str, watching: bool = False) -> bytes:
    """viser's page with this package's style and scripts.

    Until there is a picture the page shows `name` and that it loads. Where the browser renders without a graphics card,
    lights cast no shadows and reflect nothing, and the picture is coarser. For those who are `watching` it leaves out
    what they may not use.
    """
    names = ("client.css", "loading.js", "client.js", "watching.js", "strip.js", "tour.js")
    files = (Path(__file__).with_name(each) for each in names)
    style, loading, client, watched, strip, tour = (file.read_text("utf-8") for file in files)
    style = style + plots_style()
    client = client + plots_script() + strip + tour
    cover = f'<div id="motorgrad-cover" role="status"><b>{html.escape(name)}</b><span>loading the page</span></div>'
    first = f"<style>{style}</style>{cover}<script>{loading}</script>"
    if watching:
        first += f"<script>{watched}</script>"
    before, body, after = page.partition(b"<body>")
    # viser's own script waits until the document is read, and so runs after both
    return b"".join([before, body, first.encode(), after, f"<script>{client}</script>".encode()])
