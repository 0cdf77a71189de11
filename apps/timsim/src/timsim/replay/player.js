// Plays a recorded motion: a clock, cameras, names, and plots that move along.
"use strict";
const $ = id => document.getElementById(id);
const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 4, 8];
const LINES = ["#c1121f", "#0a6ebd", "#2a9134", "#b8860b", "#7b2cbf", "#d9730d", "#0f8b8d", "#c2185b", "#5b6770", "#6a994e", "#3f51b5", "#8d6e63"];
const ANGLES = {Side: [0, 0], Front: [90, 0], Oblique: [40, -14]};  // degrees, from the side view of the motion

async function unpacked() {
  const bytes = Uint8Array.from(atob($("data").textContent.trim()), letter => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  const long = new DataView(buffer).getUint32(0, true);
  const about = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, long)));
  const kinds = {f4: Float32Array, i2: Int16Array, u1: Uint8Array, u4: Uint32Array};
  for (const [name, [kind, place, shape]] of Object.entries(about.arrays)) {
    const array = new kinds[kind](buffer, 4 + long + place, shape.reduce((a, b) => a * b, 1));
    const row = array.length / (shape[0] || 1);
    if (kind === "i2") for (let i = row; i < array.length; i++) array[i] += array[i - row];
    about.arrays[name] = {data: array, row};
  }
  return about;
}

// one body: what it looks like at a moment between two frames
class Body {
  constructor(about, motion, index, renderer) {
    Object.assign(this, motion);
    this.arrays = {};
    for (const [name, array] of Object.entries(about.arrays))
      if (name.startsWith(`${index}.`)) this.arrays[name.slice(2)] = array;
    this.colours = about.colours.map(colour => colour.map(x => x / 255));
    this.prefix = `${index}.`;
    this.cameras = this.cameras.map(name => `model: ${name}`);
    for (const name of Object.keys(this.arrays)) if (name.endsWith(".points")) {
      const shape = name.slice(0, -7);
      renderer.add(this.prefix + shape, smoothMesh(this.arrays[name].data, this.arrays[`${shape}.faces`].data));
    }
    this.floors = [];
    for (const shape of this.shapes) shape.columns = columnsOf(shape.turn);
  }

  // row of an array between frames `k` and `k + 1`
  row(name, k, part) {
    const {data, row} = this.arrays[name], last = data.length / row - 1;
    const a = row * Math.min(k, last), b = row * Math.min(k + 1, last), found = new Array(row);
    for (let i = 0; i < row; i++) found[i] = data[a + i] + part * (data[b + i] - data[a + i]);
    return found;
  }

  put(renderer, k, part) {
    const origin = this.row("origin", k, part), places = this.row("places", k, part), turns = this.row("turns", k, part);
    this.where = this.bodies.map((_, i) => Vec.add(origin, Vec.mul(places.slice(3 * i, 3 * i + 3), this.scale)));
    const frames = this.bodies.map((_, i) => columnsOf(Vec.unit(turns.slice(4 * i, 4 * i + 4))));
    this.floors = [];
    for (const {shape, body, size, place, columns, colour} of this.shapes) {
      const turn = v => Vec.add(Vec.add(Vec.mul(frames[body][0], v[0]), Vec.mul(frames[body][1], v[1])), Vec.mul(frames[body][2], v[2]));
      const at = Vec.add(this.where[body], turn(place)), axes = columns.map(turn);
      if (shape === "plane" && axes[2][2] > 0.999) this.floors.push({centre: at, size});
      else if (shape === "plane") renderer.put("block", axes, [size[0] || 5, size[1] || 5, 1e-3], at, colour);
      else if (shape === "ball") renderer.put("ball", axes, [size[0], size[0], size[0]], at, colour);
      else if (shape === "egg") renderer.put("ball", axes, size, at, colour);
      else if (shape === "block") renderer.put("block", axes, size, at, colour);
      else if (shape === "rod" || shape === "capsule") {
        renderer.put("rod", axes, [size[0], size[0], size[1]], at, colour);
        if (shape === "capsule") for (const end of [-1, 1])
          renderer.put("ball", axes, [size[0], size[0], size[0]], Vec.add(at, Vec.mul(axes[2], end * size[1])), colour);
      } else renderer.put(this.prefix + shape, axes, [1, 1, 1], at, colour);
    }
    this.muscles(renderer, k, part, origin);
    const marks = this.row("marks", part < 0.5 ? k : k + 1, 0);
    for (let i = 0; i < marks.length; i += 4)
      renderer.put("ball", columnsOf([1, 0, 0, 0]), [marks[i + 3], marks[i + 3], marks[i + 3]], marks.slice(i, i + 3), this.mark);
  }

  muscles(renderer, k, part, origin) {
    const paths = this.row("paths", k, part), levels = this.row("levels", k, part), [silent, firing, passive] = this.colours;
    let first = 0;
    for (const [tendon, count, radius] of this.pieces) {
      const level = Math.min(1, levels[tendon] / 254), still = this.arrays.levels.data[tendon] === 255;
      const colour = still ? passive : silent.map((x, i) => x + level * (firing[i] - x));
      const thick = radius * (still ? 1 : 1 + this.swell * level), paint = [...colour, 1];
      let before = null;
      for (let i = first; i < first + count; i++) {
        const at = Vec.add(origin, Vec.mul(paths.slice(3 * i, 3 * i + 3), this.scale));
        if (before) this.tube(renderer, before, at, thick, paint);
        before = at;
      }
      first += count;
    }
  }

  tube(renderer, from, to, thick, colour) {
    const along = Vec.sub(to, from), long = Math.hypot(...along);
    if (long < 1e-7) return;
    const z = Vec.mul(along, 1 / long), x = Vec.unit(Vec.cross(z, Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
    renderer.put("rod", [x, Vec.cross(z, x), z], [thick, thick, long / 2], Vec.mul(Vec.add(from, to), 0.5), colour);
    for (const end of [from, to]) renderer.put("ball", [x, Vec.cross(z, x), z], [thick, thick, thick], end, colour);
  }
}

class Player {
  constructor(about) {
    this.about = about;
    this.renderer = new Renderer($("picture"));
    this.bodies = about.motions.map((motion, index) => new Body(about, motion, index, this.renderer));
    this.moments = about.arrays.moments.data;
    this.end = this.moments[this.moments.length - 1];
    this.time = 0; this.speed = 1; this.playing = false; this.dirty = true;
    [this.azimuth, this.elevation] = this.bodies[0].angles;
    this.side = [this.azimuth, this.elevation];
    this.zoom = 1; this.shift = [0, 0]; this.camera = "Side";
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.dark.addEventListener("change", () => this.renew());
    this.plots = about.plots.map((plot, i) => new LinePlot(plot, about.arrays[`plot${i}.time`].data, about.arrays[`plot${i}.values`], this));
    this.controls();
    this.handles();
    this.read();
    new ResizeObserver(() => this.renew()).observe($("picture"));
    addEventListener("resize", () => this.renew());
    requestAnimationFrame(now => this.step(now));
  }

  renew() { this.dirty = true; for (const plot of this.plots) plot.renew(); }

  controls() {
    const [pale, , ] = this.about.colours.map(colour => `rgb(${colour})`), strong = `rgb(${this.about.colours[1]})`;
    $("legend").querySelector("i").style.background = `linear-gradient(90deg, ${pale}, ${strong})`;
    $("legend").hidden = !this.bodies.some(body => body.pieces.length);
    if ($("legend").hidden) $("legend").style.display = "none";
    Object.assign($("time"), {max: this.end, step: "any"});
    for (const speed of SPEEDS) $("speed").add(new Option(`${speed}×`, speed, speed === 1, speed === 1));
    $("time").oninput = () => { this.pause(); this.seek(+$("time").value); };
    $("play").onclick = () => this.toggle();
    $("speed").onchange = () => { this.speed = +$("speed").value; this.write(); };
    $("names").onchange = () => { this.dirty = true; };
    const cameras = [...Object.keys(ANGLES), "Above", ...this.bodies[0].cameras];
    this.buttons = cameras.map(name => {
      const button = document.createElement("button");
      button.textContent = name;
      button.onclick = () => { this.look(name); this.write(); };
      $("cameras").append(button);
      return button;
    });
    addEventListener("keydown", event => {
      if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select, input")) return;
      const frame = this.end / Math.max(1, this.moments.length - 1);
      if (event.key === " " && event.target.tagName !== "BUTTON") this.toggle();
      else if (event.key === "ArrowRight") { this.pause(); this.seek(this.time + frame); }
      else if (event.key === "ArrowLeft") { this.pause(); this.seek(this.time - frame); }
      else return;
      event.preventDefault();
    });
  }

  handles() {
    const canvas = $("picture"), held = new Map();
    const apart = () => { const [a, b] = [...held.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
    canvas.onpointerdown = event => { canvas.setPointerCapture(event.pointerId); held.set(event.pointerId, event); };
    canvas.onpointerup = canvas.onpointercancel = event => { held.delete(event.pointerId); this.write(); };
    canvas.onpointermove = event => {
      const last = held.get(event.pointerId);
      if (!last) return;
      const dx = event.clientX - last.clientX, dy = event.clientY - last.clientY, before = held.size === 2 ? apart() : 0;
      held.set(event.pointerId, event);
      this.release();
      if (before) this.zoom *= before / Math.max(1, apart());
      else if (event.shiftKey || event.buttons === 2) this.shift = [this.shift[0] - dx, this.shift[1] + dy];
      else {
        this.azimuth -= 0.4 * dx;
        this.elevation = Math.max(-90, Math.min(20, this.elevation - 0.4 * dy));
      }
      this.dirty = true;
    };
    canvas.oncontextmenu = event => event.preventDefault();
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      this.release();
      this.zoom = Math.max(0.05, Math.min(20, this.zoom * Math.exp(0.001 * event.deltaY)));
      this.dirty = true;
      this.write();
    }, {passive: false});
  }

  look(name) {
    this.camera = name; this.zoom = 1; this.shift = [0, 0];
    const [azimuth, elevation] = this.side;
    if (ANGLES[name]) [this.azimuth, this.elevation] = [azimuth + ANGLES[name][0], (ANGLES[name][1] || elevation)];
    if (name === "Above") [this.azimuth, this.elevation] = [azimuth, -89.9];
    this.dirty = true;
  }

  // a camera of the model gives way to a free one that looks the same way
  release() {
    if (this.camera === null) return;
    const seen = this.bodies[0].cameras.includes(this.camera) ? this.view(this.bodies[0], 1).towards : null;
    if (seen) {
      this.azimuth = Math.atan2(-seen[1], -seen[0]) * 180 / Math.PI;
      this.elevation = -Math.asin(Math.max(-1, Math.min(1, seen[2]))) * 180 / Math.PI;
    }
    this.camera = null;
  }

  view(body, aspect) {
    const [k, part] = this.place, chosen = this.camera === null ? -1 : body.cameras.indexOf(this.camera);
    const target = body.row("centres", k, part);
    if (chosen >= 0) {
      const all = body.row("eyes", k, part).slice(12 * chosen, 12 * chosen + 12);
      const axis = i => Vec.unit([all[3 + i], all[6 + i], all[9 + i]]);
      return {eye: all.slice(0, 3), right: axis(0), up: axis(1), towards: axis(2), fovy: body.fovy[chosen], target, far: 0};
    }
    const a = this.azimuth * Math.PI / 180, e = this.elevation * Math.PI / 180, fovy = 36;
    const right = [Math.sin(a), -Math.cos(a), 0];
    const towards = [-Math.cos(a) * Math.cos(e), -Math.sin(a) * Math.cos(e), -Math.sin(e)];
    const up = Vec.cross(towards, right), tan = Math.tan(fovy * Math.PI / 360);
    let far = 0;
    for (const other of this.bodies) for (let corner = 0; corner < 8; corner++) {
      const at = other.half.map((h, i) => corner >> i & 1 ? h : -h);
      const reach = Math.max(Math.abs(Vec.dot(at, right)) / (0.9 * aspect), Math.abs(Vec.dot(at, up)) / 0.76);
      far = Math.max(far, reach / tan + Vec.dot(at, towards));
    }
    far *= this.zoom;
    const pixel = 2 * far * tan / Math.max(1, $("picture").clientHeight);
    const middle = Vec.add(target, Vec.add(Vec.mul(right, this.shift[0] * pixel), Vec.mul(up, this.shift[1] * pixel)));
    return {eye: Vec.add(middle, Vec.mul(towards, far)), right, up, towards, fovy, target: middle, far};
  }

  toggle() { if (this.playing) this.pause(); else { if (this.time >= this.end) this.time = 0; this.play(true); } }
  pause() { if (this.playing) this.play(false); }
  play(on) {
    this.playing = on; this.last = null;
    $("play").textContent = on ? "❚❚" : "▶";
    $("play").setAttribute("aria-label", on ? "Pause" : "Play");
    if (!on) this.write();
  }

  seek(time) {
    this.time = Math.max(0, Math.min(this.end, time));
    this.dirty = true;
    this.write();
  }

  step(now) {
    if (this.playing) {
      this.time += this.last == null ? 0 : this.speed * (now - this.last) / 1000;
      this.last = now;
      if (this.time >= this.end) {
        if ($("loop").checked && this.end > 0) this.time %= this.end;
        else { this.time = this.end; this.play(false); }
      }
      this.dirty = true;
    }
    if (this.dirty) { this.dirty = false; this.draw(); }
    requestAnimationFrame(later => this.step(later));
  }

  draw() {
    const count = this.moments.length, whole = this.end > 0 ? this.time / this.end * (count - 1) : 0;
    const k = Math.min(Math.floor(whole), Math.max(0, count - 2)), canvas = $("picture");
    this.place = [k, whole - k];
    const ratio = Math.min(2, devicePixelRatio || 1), wide = canvas.clientWidth, high = canvas.clientHeight;
    if (canvas.width !== Math.round(wide * ratio) || canvas.height !== Math.round(high * ratio))
      [canvas.width, canvas.height] = [Math.round(wide * ratio), Math.round(high * ratio)];
    const dark = this.dark.matches;
    const look = dark ? {sky: [.10, .12, .14], ground: [.17, .19, .22], line: [.29, .32, .36], shade: [.11, .12, .14]}
      : {sky: [.93, .95, .97], ground: [.86, .88, .90], line: [.70, .73, .77], shade: [.67, .69, .72]};
    const stacked = wide < high * 1.1, words = [];
    this.bodies.forEach((body, i) => {
      const n = this.bodies.length, [w, h] = stacked ? [wide, high / n] : [wide / n, high], [x, y] = stacked ? [0, i * h] : [i * w, 0];
      const camera = this.view(body, w / h);
      const reach = 8 * Math.max(Math.hypot(...Vec.sub(camera.eye, camera.target)), 2 * Math.hypot(...body.half));
      this.renderer.clear();
      body.put(this.renderer, ...this.place);
      const arrows = i ? [] : this.arrows(body);
      const box = [x, high - y - h, w, h].map(length => Math.round(length * ratio));
      const eye = this.renderer.draw(box, camera, body.floors, look, body.grid, reach);
      const title = body.label || (n === 1 ? this.about.title : "");
      if (title) words.push(["title", title, x + 14, y + 10]);
      const write = (name, at) => {
        const [px, py, , q] = [0, 1, 2, 3].map(r => eye[r] * at[0] + eye[4 + r] * at[1] + eye[8 + r] * at[2] + eye[12 + r]);
        if (q > 0 && name) words.push(["name", name, x + w * (1 + px / q) / 2, y + h * (1 - py / q) / 2]);
      };
      if ($("names").checked) body.bodies.forEach((name, j) => { if (body.named[j]) write(name, body.where[j]); });
      for (const [name, at] of arrows) write(name, at);
    });
    this.say(words);
    const {text} = this.about.arrays, added = text ? this.about.added.texts[text.data[Math.round(whole)]] : "";
    if ($("added").textContent !== added) $("added").textContent = added;
    $("clock").textContent = `${this.time.toFixed(2)} s${this.speed === 1 ? "" : `  ×${this.speed}`}`;
    $("time").value = this.time;
    $("time").setAttribute("aria-valuetext", `${this.time.toFixed(2)} of ${this.end.toFixed(2)} s`);
    this.buttons.forEach(button => button.setAttribute("aria-pressed", button.textContent === this.camera));
    for (const plot of this.plots) plot.draw(this.time);
  }

  // the arrows that a program added, each a rod and a cone of rods; their names and tips
  arrows(body) {
    const {arrow} = this.about.arrays, [k, part] = this.place, found = [];
    if (!arrow || !arrow.row) return found;
    const last = arrow.data.length / arrow.row - 1, a = arrow.row * Math.min(k, last), b = arrow.row * Math.min(k + 1, last);
    this.about.added.arrows.forEach(({name, colour, radius}, i) => {
      const ends = [...Array(6).keys()].map(j => 6 * i + j).map(j => arrow.data[a + j] + part * (arrow.data[b + j] - arrow.data[a + j]));
      if (!ends.every(Number.isFinite)) return;
      const from = ends.slice(0, 3), to = ends.slice(3), way = Vec.sub(to, from), long = Math.hypot(...way);
      const head = Math.min(long, 6 * radius), at = step => Vec.add(to, Vec.mul(way, -step * head / (long || 1)));
      const paint = [...colour, 1], z = Vec.mul(way, 1 / (long || 1)), x = Vec.unit(Vec.cross(z, Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
      body.tube(this.renderer, from, at(1), radius, paint);
      for (let step = 0.5; step < 16; step++)
        this.renderer.put("rod", [x, Vec.cross(z, x), z], [2.5 * radius * step / 16, 2.5 * radius * step / 16, head / 32], at(step / 16), paint);
      found.push([name, to]);
    });
    return found;
  }

  say(words) {
    const shown = $("words").children;
    while (shown.length < words.length) $("words").append(document.createElement("span"));
    [...shown].forEach((element, i) => {
      const [kind, text, x, y] = words[i] || ["", "", 0, 0];
      element.className = kind;
      if (element.textContent !== text) element.textContent = text;
      element.style.left = `${x}px`; element.style.top = `${y}px`;
    });
  }

  // the address keeps moment and view, to be passed on
  write() {
    const told = new URLSearchParams({t: this.time.toFixed(3)});
    if (this.speed !== 1) told.set("speed", this.speed);
    if (this.camera) told.set("camera", this.camera);
    else told.set("view", [this.azimuth, this.elevation, this.zoom, ...this.shift].map(x => +x.toFixed(2)).join(" "));
    clearTimeout(this.later);
    this.later = setTimeout(() => history.replaceState(null, "", `#${told}`), 200);
  }

  read() {
    const told = new URLSearchParams(location.hash.slice(1)), camera = told.get("camera");
    const view = (told.get("view") || "").split(/[ +]/).map(Number);
    if (SPEEDS.includes(+told.get("speed"))) $("speed").value = this.speed = +told.get("speed");
    if (view.length === 5 && view.every(Number.isFinite)) {
      [this.azimuth, this.elevation, this.zoom, ...this.shift] = view;
      this.camera = null;
    } else this.look(this.buttons.some(button => button.textContent === camera) ? camera : "Side");
    const time = +told.get("t");
    this.time = Math.max(0, Math.min(this.end, Number.isFinite(time) ? time : 0));
    if (!told.has("t")) this.play(true);
  }
}

class LinePlot {
  constructor({title, unit, names, of}, time, {data, row}, player) {
    Object.assign(this, {unit, names, time, player});
    this.lines = names.map((_, i) => data.subarray(i * row, (i + 1) * row));
    const finite = data.filter(Number.isFinite);
    let low = finite.reduce((a, b) => Math.min(a, b), Infinity), high = finite.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!(low < high)) [low, high] = finite.length ? [low - 1, high + 1] : [0, 1];
    [this.low, this.high] = [low - 0.04 * (high - low), high + 0.04 * (high - low)];
    const figure = document.createElement("figure"), caption = document.createElement("figcaption"), small = document.createElement("small");
    caption.textContent = title;
    small.textContent = (unit ? ` (${unit})` : "") + (of ? ` — the ${names.length} of ${of} that vary most` : "");
    caption.append(small);
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${title} over time`);
    const list = document.createElement("ul");
    this.values = names.map((_, i) => {
      const item = document.createElement("li");
      item.style.setProperty("--line", LINES[i % LINES.length]);
      list.append(item);
      return item;
    });
    figure.append(caption, this.canvas, list);
    $("plots").append(figure);
    const go = event => {
      if (event.type === "pointermove" && !event.buttons) return;
      const box = this.canvas.getBoundingClientRect();
      player.pause();
      player.seek((event.clientX - box.left - this.left) / (box.width - this.left - 8) * player.end);
    };
    this.canvas.onpointerdown = this.canvas.onpointermove = go;
    this.left = 44;
  }

  renew() { this.still = null; }

  ticks(low, high, most) {
    const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map(x => x * power).find(x => x >= rough), found = [];
    for (let i = Math.ceil(low / step); i * step <= high; i++) found.push(i * step);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    return found.map(x => [x, (x || 0).toFixed(digits)]);
  }

  draw(now) {
    const ratio = Math.min(2, devicePixelRatio || 1), wide = this.canvas.clientWidth, high = this.canvas.clientHeight;
    const left = this.left, bottom = high - 18, end = this.player.end || 1, pen = this.canvas.getContext("2d");
    const x = t => left + t / end * (wide - left - 8), y = v => 6 + (this.high - v) / (this.high - this.low) * (bottom - 6);
    if (!this.still) {
      this.still = document.createElement("canvas");
      for (const canvas of [this.canvas, this.still])
        [canvas.width, canvas.height] = [Math.max(1, Math.round(wide * ratio)), Math.max(1, Math.round(high * ratio))];
      const pen = this.still.getContext("2d"), style = getComputedStyle(document.documentElement), faint = style.getPropertyValue("--faint"), edge = style.getPropertyValue("--edge");
      this.ink = style.getPropertyValue("--ink");
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.font = "11px system-ui, sans-serif";
      pen.textBaseline = "middle"; pen.textAlign = "right";
      for (const [value, text] of this.ticks(this.low, this.high, 4)) {
        pen.strokeStyle = edge; pen.beginPath(); pen.moveTo(left, y(value)); pen.lineTo(wide - 8, y(value)); pen.stroke();
        pen.fillStyle = faint; pen.fillText(text, left - 5, y(value));
      }
      pen.textAlign = "center";
      const times = this.ticks(0, end, Math.max(2, wide / 80));
      times.forEach(([value, text], i) => {
        if (x(value) > wide - 20 && i) return;
        pen.fillText(i === times.length - 1 || x(times[Math.min(i + 1, times.length - 1)][0]) > wide - 20 ? `${text} s` : text, x(value), bottom + 10);
      });
      this.lines.forEach((line, i) => {
        pen.strokeStyle = LINES[i % LINES.length]; pen.lineWidth = 1.4; pen.beginPath();
        let drawn = false;
        line.forEach((value, j) => {
          if (!Number.isFinite(value)) { drawn = false; return; }
          if (drawn) pen.lineTo(x(this.time[j]), y(value)); else pen.moveTo(x(this.time[j]), y(value));
          drawn = true;
        });
        pen.stroke();
      });
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, wide, high);
    pen.drawImage(this.still, 0, 0, wide, high);
    pen.strokeStyle = this.ink; pen.lineWidth = 1.2;
    pen.beginPath(); pen.moveTo(x(now), 4); pen.lineTo(x(now), bottom); pen.stroke();
    let low = 0, high2 = this.time.length - 1;
    while (low < high2) { const middle = (low + high2 + 1) >> 1; if (this.time[middle] <= now + 1e-6) low = middle; else high2 = middle - 1; }
    this.names.forEach((name, i) => {
      const value = this.lines[i][low];
      this.values[i].textContent = `${name} ${Number.isFinite(value) ? `${+value.toPrecision(3)}${this.unit === "°" ? "°" : this.unit ? ` ${this.unit}` : ""}` : "–"}`;
    });
  }
}

unpacked().then(about => { window.player = new Player(about); document.body.dataset.ready = "true"; }).catch(error => {
  $("fault").hidden = false;
  $("fault").textContent = `This replay cannot be shown: ${error.message}`;
});
