// Before viser's own scripts: words while the page loads, and less to draw where a browser has no graphics card.
(() => {
  const DETAIL = 0.6;  // pixels drawn for each of the screen's, along a side, by software
  const RENDERER = 0x9246, FRAMES = 6;  // the picture comes some frames after the first message about it
  const gl = document.createElement("canvas").getContext("webgl2");
  const asked = gl && gl.getExtension("WEBGL_debug_renderer_info") ? String(gl.getParameter(RENDERER)) : "";
  const software = /swiftshader|llvmpipe|softpipe|software|basic render/i.test(asked);
  if (gl) gl.getExtension("WEBGL_lose_context")?.loseContext();
  const cover = document.getElementById("motorgrad-cover");
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
      // `event.data` is one object for all listeners, and this listener is the first
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
    place.searchParams.set("fixedDpr", String(DETAIL));
    history.replaceState(history.state, "", place);
  }
})();
