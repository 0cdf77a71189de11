// Before viser's own scripts: words while the page loads, and less to draw where a browser has no graphics card.
(() => {
  // viser connects to its own address and knows no #; the other script comes back to what stood behind it
  window.motorgrad = { fragment: location.hash, send: () => {} };
  if (location.hash) history.replaceState(null, "", location.pathname + location.search);
  const DETAIL = 0.6;  // pixels drawn for each of the screen's, along a side, by software
  const RENDERER = 0x9246, FRAMES = 6, PATIENCE = 15000;  // ms; the picture comes some frames after the first message about it
  const gl = document.createElement("canvas").getContext("webgl2");
  const asked = gl && gl.getExtension("WEBGL_debug_renderer_info") ? String(gl.getParameter(RENDERER)) : "";
  const software = /swiftshader|llvmpipe|softpipe|software|basic render/i.test(asked);
  if (gl) gl.getExtension("WEBGL_lose_context")?.loseContext();
  const cover = document.getElementById("motorgrad-cover");
  let shown = false;
  const uncover = () => { cover.style.opacity = 0; setTimeout(() => cover.remove(), 300); };
  const count = frames => requestAnimationFrame(() => frames ? count(frames - 1) : uncover());
  // until there is a picture the server says what it does in an element of the panel
  const begun = Date.now();
  let words = cover.lastElementChild.textContent, waits = false, since = begun;
  const say = () => {
    const seconds = Math.round((Date.now() - begun) / 1000);
    cover.lastElementChild.textContent = seconds > 1 ? `${words} … ${seconds} s` : `${words} …`;
  };
  const tell = content => {
    const found = /class="motorgrad-progress">(.*)<\/div>/s.exec(content);
    if (!found) return;
    words = new DOMParser().parseFromString(found[1], "text/html").body.textContent;
    waits = true;
    if (/could not start/.test(words)) { clearInterval(clock); cover.lastElementChild.textContent = words; } else say();
  };
  const clock = setInterval(() => {
    if (!cover.isConnected) clearInterval(clock);
    else if (!waits && Date.now() - since > PATIENCE) uncover();
    else say();
  }, 500);
  const look = messages => {
    for (const message of messages) {
      if (software && message.type === "DirectionalLightMessage") message.props.cast_shadow = false;
      if (software && message.type === "EnvironmentMapMessage") message.hdri_data = null;
      const content = (message.props || message.updates || {}).content;
      if (!shown && typeof content === "string") tell(content);
      if (message.type === "GuiRemoveMessage") { waits = false; since = Date.now(); }  // that element, once all is drawn
      if (!shown && /^(Batched)?(Mesh|Glb|Label)/.test(message.type)) { shown = true; count(FRAMES); }
    }
  };
  window.Worker = class extends Worker {
    constructor(...given) {
      super(...given);
      window.motorgrad.send = message => this.postMessage({ type: "send", message });
      // `event.data` is one object for all listeners, and this listener is the first
      this.addEventListener("message", event => {
        const data = event.data;
        if (data && Array.isArray(data.messages)) look(data.messages);
      });
    }
  };
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
