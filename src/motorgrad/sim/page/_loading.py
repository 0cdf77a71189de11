"""What the served page adds to viser's: words while it loads, and less to draw where a browser has no graphics card."""

from __future__ import annotations

import html

COVER = """
<style>
#motorgrad-cover { position: fixed; inset: 0; z-index: 9999; display: flex; flex-direction: column; gap: 0.5em;
  align-items: center; justify-content: center; font: 16px system-ui, sans-serif; background: #dfe6ea; color: #2b3036;
  transition: opacity 0.3s; }
#motorgrad-cover b { font-size: 22px; }
@media (prefers-color-scheme: dark) { #motorgrad-cover { background: #23282e; color: #d7dde2; } }
</style>
<div id="motorgrad-cover" role="status"><b>NAME</b><span>loading the view …</span></div>
"""
# `event.data` is one object for all listeners, and this listener is the first
SCRIPT = """
<script>
(() => {
  const RENDERER = 0x9246, FRAMES = 6;  // the picture comes some frames after the first message about it
  const gl = document.createElement("canvas").getContext("webgl2");
  const asked = gl && gl.getExtension("WEBGL_debug_renderer_info") ? String(gl.getParameter(RENDERER)) : "";
  const software = /swiftshader|llvmpipe|softpipe|software|basic render/i.test(asked);
  if (gl) gl.getExtension("WEBGL_lose_context")?.loseContext();
  const cover = document.getElementById("motorgrad-cover"), begun = Date.now();
  let shown = false;
  const uncover = () => { cover.style.opacity = 0; setTimeout(() => cover.remove(), 300); };
  const count = frames => requestAnimationFrame(() => frames ? count(frames - 1) : uncover());
  const look = messages => {
    for (const message of messages) {
      if (software && message.type === "DirectionalLightMessage") message.props.cast_shadow = false;
      if (software && message.type === "EnvironmentMapMessage") message.hdri_data = null;
      if (!shown && /Mesh|Glb|Label/.test(message.type)) { shown = true; count(FRAMES); }
    }
  };
  window.Worker = class extends Worker {
    constructor(...given) {
      super(...given);
      this.addEventListener("message", event => {
        const data = event.data;
        if (data && Array.isArray(data.messages)) look(data.messages);
      });
    }
  };
  setTimeout(() => { if (cover.isConnected) uncover(); }, 15000);
  if (!software) return;
  // viser's notice that the browser renders in software covers the picture, and asks for nothing that the user can do
  for (const kind of [WebGLRenderingContext, WebGL2RenderingContext]) {
    const read = kind.prototype.getParameter;
    kind.prototype.getParameter = function (name) { return name === RENDERER ? "processor" : read.call(this, name); };
  }
  const make = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, given) {
    return make.call(this, kind, kind.startsWith("webgl") ? {...given, antialias: false} : given);
  };
  const place = new URL(location.href);
  if (!place.searchParams.has("fixedDpr")) {
    place.searchParams.set("fixedDpr", "DETAIL");
    history.replaceState(history.state, "", place);
  }
})();
</script>
"""
DETAIL = 0.6  # pixels drawn for each of the screen's, along a side, by software


def with_cover(page: bytes, name: str) -> bytes:
    """viser's page, which says `name` and that it loads until there is a picture.

    Where the browser renders without a graphics card, lights cast no shadows and reflect nothing, and the picture is
    coarser.
    """
    before, mark, after = page.partition(b"<body>")
    cover = COVER.replace("NAME", html.escape(name)) + SCRIPT.replace("DETAIL", str(DETAIL))
    # the script runs before viser's own, which waits until the document is read
    return before + mark + cover.encode() + after
