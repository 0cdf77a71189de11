// Plots of the run, of one's choice: on a page of their own, and in a strip below the scene.
const motorgradPlots = (root, { strip, closed }) => {
  const PERIOD = 500, HIGH = 250, LEAST = 330;  // ms; pixels
  root.innerHTML = `<header><b></b><span class="time"></span><span class="bodies"></span>
    <button class="choose" aria-expanded="false">Choose</button></header>
    <div class="list"><input type="search" placeholder="Search" aria-label="Search the plots"></div>
    <div class="grid"></div>`;
  const [title, time, bodies] = root.querySelector("header").children;
  const choose = root.querySelector(".choose"), list = root.querySelector(".list"), grid = root.querySelector(".grid");
  if (strip) {
    title.remove();
    const apart = Object.assign(document.createElement("a"), { className: "button", textContent: "Own window" });
    apart.href = "plots";
    apart.target = "_blank";
    const close = Object.assign(document.createElement("button"), { textContent: "Close" });
    close.onclick = () => { stopped = true; closed(); };
    choose.after(apart, close);
  }
  let stopped = false, chosen = [], names = [], key = "";
  const remember = () => { try { localStorage.setItem(key, JSON.stringify(chosen.map(each => names[each]))); } catch { /* private */ } };
  const figures = new Map();
  const place = () => {
    for (const [number, figure] of figures) if (!chosen.includes(number)) { figure.remove(); figures.delete(number); }
    for (const number of chosen) {
      if (!figures.has(number)) figures.set(number, document.createElement("figure"));
      grid.append(figures.get(number));
    }
  };
  const size = () => {
    if (strip) {
      const wide = grid.clientWidth - 24 - 8 * (chosen.length - 1);
      return [Math.max(LEAST, Math.floor(wide / Math.max(1, chosen.length)) - 2), Math.max(120, grid.clientHeight - 12)];
    }
    const first = grid.querySelector("figure"), wide = first ? first.clientWidth : 400;
    // as high as there is room for all of them, between two limits
    const columns = Math.max(1, Math.floor((grid.clientWidth - 16) / (wide + 8)));
    const rows = Math.ceil(Math.max(1, chosen.length) / columns), room = window.innerHeight - grid.offsetTop - 24;
    return [wide, Math.max(HIGH, Math.min(0.7 * wide, room / rows - 10))];
  };
  const later = () => { if (!stopped) setTimeout(renew, PERIOD); };
  const renew = async () => {
    if (stopped || !root.isConnected) return;
    if (document.hidden || root.classList.contains("choosing") && strip) return later();
    try {
      const [wide, high] = size().map(Math.round);
      const found = await (await fetch(`plots/figures/${wide}x${high}/${chosen.join(",")}`)).json();
      if (found.error) { time.textContent = found.error; return later(); }
      for (const [number, svg] of Object.entries(found.drawn)) {
        const figure = figures.get(Number(number));
        if (figure) figure.innerHTML = svg;
      }
      time.textContent = `${found.seconds.toFixed(1)} s${found.playing ? "" : " · paused"}`;
      bodies.replaceChildren(...(found.bodies.length < 2 ? [] : found.bodies.map((each, row) => {
        const name = Object.assign(document.createElement("span"), { textContent: each.label });
        name.style.setProperty("--mine", row ? each.colour : "var(--first)");
        return name;
      })));
    } catch { time.textContent = "the run cannot be reached"; }
    later();
  };
  const begin = async () => {
    let about;
    try { about = await (await fetch("plots/list")).json(); } catch { about = { error: "the run cannot be reached" }; }
    if (about.error) { time.textContent = about.error; if (!stopped) setTimeout(begin, 1000); return; }
    names = about.figures.map(each => each.name);
    title.textContent = about.title;
    if (!strip) document.title = `${about.title}: plots`;
    key = `motorgrad-plots ${about.title}`;
    let kept = null;
    try { kept = JSON.parse(localStorage.getItem(key)); } catch { /* private */ }
    chosen = Array.isArray(kept) ? kept.map(name => names.indexOf(name)).filter(each => each >= 0) : about.first;
    let group = "";
    about.figures.forEach((each, number) => {
      if (each.group !== group) {
        group = each.group;
        list.append(Object.assign(document.createElement("h3"), { textContent: group }));
      }
      const label = document.createElement("label"), box = document.createElement("input");
      Object.assign(box, { type: "checkbox", checked: chosen.includes(number) });
      box.onchange = () => {
        chosen = box.checked ? [...chosen, number].slice(-24) : chosen.filter(other => other !== number);
        place();
        remember();
      };
      label.append(box, ` ${each.name}`);
      list.append(label);
    });
    list.querySelector("input").oninput = event => {
      const word = event.target.value.toLowerCase();
      for (const label of list.querySelectorAll("label")) label.hidden = !label.textContent.toLowerCase().includes(word);
    };
    place();
    renew();
  };
  choose.onclick = () => choose.setAttribute("aria-expanded", root.classList.toggle("choosing"));
  begin();
};
