// For those who may only watch: shows of viser's inputs and keys those alone that the server will listen to.
(() => {
  const INPUT = new RegExp("^Gui(Button|ButtonGroup|UploadButton|Slider|MultiSlider|Number|Rgb|Rgba|Checkbox|Vector2|" +
    "Vector3|Text|Dropdown|Folder|Form)Message$");
  const SHOWN = /^Gui(Html|Markdown|Image|Plotly|Uplot|ProgressBar)Message$/;
  let own, parents, hidden, commands;
  const begin = () => {
    own = new Set(); parents = new Map(); hidden = new Set(); commands = new Map();
  };
  begin();
  // an element, and the folders around it
  const show = (uuid, messages) => {
    for (; uuid !== undefined; uuid = parents.get(uuid)) {
      if (hidden.delete(uuid)) messages.push({ type: "GuiUpdateMessage", uuid, updates: { visible: true } });
    }
  };
  const take = (words, messages) => {
    for (const uuid of words.split(" ").filter(Boolean)) {
      own.add(uuid);
      show(uuid, messages);
      if (commands.has(uuid)) messages.push(commands.get(uuid));
      commands.delete(uuid);
    }
  };
  const screen = messages => {
    for (let place = 0; place < messages.length; place++) {  // it grows meanwhile
      const message = messages[place], { type, uuid, props } = message;
      if (type === "RegisterCommandMessage" && !own.has(uuid)) {
        commands.set(uuid, message);
        messages.splice(place--, 1);
      } else if (INPUT.test(type)) {
        parents.set(uuid, message.container_uuid);
        if (own.has(uuid)) show(message.container_uuid, messages);
        else { hidden.add(uuid); props.visible = false; }
      } else if (SHOWN.test(type)) {
        const words = props.content || "";
        if (words && !/^<div class="motorgrad-/.test(words)) show(message.container_uuid, messages);
      } else if (type === "GuiUpdateMessage" && message.updates) {
        if (hidden.has(uuid)) delete message.updates.visible;
        const found = /class="motorgrad-own" data-own="([^"]*)"/.exec(message.updates.content || "");
        if (found) take(found[1], messages);
      } else if (/^SetSceneNode(Click|Drag)Bindings/.test(type)) {
        messages.splice(place--, 1);  // nothing here can be chosen or pushed
      }
    }
  };
  window.Worker = class extends Worker {
    constructor(...given) {
      super(...given);
      this.addEventListener("message", event => {
        const data = event.data;
        if (data && data.type === "connected") begin();
        if (data && Array.isArray(data.messages)) screen(data.messages);
      });
    }
  };
  document.documentElement.classList.add("motorgrad-watching");
  const badge = document.createElement("div");
  badge.className = "motorgrad-badge";
  badge.textContent = "watching only";
  badge.title = "Turn the camera, switch tabs, choose your own chart. Whoever has the other address drives the run.";
  document.body.append(badge);
})();
