// Draws solid shapes with WebGL 2: each shape once, with all of its copies in one call.
"use strict";
const Vec = {
  add: (a, b) => a.map((x, i) => x + b[i]),
  sub: (a, b) => a.map((x, i) => x - b[i]),
  mul: (a, s) => a.map(x => x * s),
  dot: (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0),
  cross: (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
  unit: a => Vec.mul(a, 1 / (Math.hypot(...a) || 1)),
};

// the columns of the rotation of a quaternion w, x, y, z
function columnsOf([w, x, y, z]) {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
    [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
  ];
}

function ballMesh(around = 28, along = 16) {
  const points = [], faces = [];
  for (let i = 0; i <= along; i++) for (let j = 0; j <= around; j++) {
    const a = Math.PI * i / along, b = 2 * Math.PI * j / around;
    points.push(Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a));
  }
  for (let i = 0; i < along; i++) for (let j = 0; j < around; j++) {
    const k = i * (around + 1) + j, l = k + around + 1;
    faces.push(k, l, k + 1, k + 1, l, l + 1);
  }
  return {points, normals: points, faces};
}

function rodMesh(around = 28) {  // from z = -1 to 1, of radius 1
  const points = [], normals = [], faces = [];
  for (const [z, nz] of [[-1, 0], [1, 0], [-1, -1], [1, 1]]) for (let j = 0; j <= around; j++) {
    const b = 2 * Math.PI * j / around, x = Math.cos(b), y = Math.sin(b);
    points.push(x, y, z);
    normals.push(...(nz ? [0, 0, nz] : [x, y, 0]));
  }
  const row = around + 1;
  for (let j = 0; j < around; j++) {
    faces.push(j, j + 1, row + j, j + 1, row + j + 1, row + j);
    for (const start of [2 * row, 3 * row]) if (j) faces.push(start, start + j, start + j + 1);
  }
  return {points, normals, faces};
}

function blockMesh() {
  const points = [], normals = [], faces = [];
  for (let axis = 0; axis < 3; axis++) for (const side of [-1, 1]) {
    const first = points.length / 3;
    for (const [u, v] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
      const p = [0, 0, 0], n = [0, 0, 0];
      p[axis] = n[axis] = side; p[(axis + 1) % 3] = u; p[(axis + 2) % 3] = v;
      points.push(...p); normals.push(...n);
    }
    faces.push(first, first + 1, first + 2, first, first + 2, first + 3);
  }
  return {points, normals, faces};
}

function smoothMesh(points, faces) {  // normals are means over the triangles, weighted by their areas
  const normals = new Float32Array(points.length);
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [0, 1, 2].map(k => Array.from(points.subarray(3 * faces[f + k], 3 * faces[f + k] + 3)));
    const n = Vec.cross(Vec.sub(b, a), Vec.sub(c, a));
    for (let k = 0; k < 3; k++) for (let i = 0; i < 3; i++) normals[3 * faces[f + k] + i] += n[i];
  }
  return {points, normals, faces};
}

const SOLID = [`#version 300 es
layout(location=0) in vec3 point; layout(location=1) in vec3 normal;
layout(location=2) in vec4 a; layout(location=3) in vec4 b; layout(location=4) in vec4 c; layout(location=5) in vec4 d;
uniform mat4 eye; uniform vec3 sun; uniform float ground; uniform bool shadow;
out vec3 n; out vec3 place; out vec4 colour;
void main() {
  place = a.xyz * point.x + b.xyz * point.y + c.xyz * point.z + d.xyz;
  n = a.xyz * normal.x / dot(a.xyz, a.xyz) + b.xyz * normal.y / dot(b.xyz, b.xyz) + c.xyz * normal.z / dot(c.xyz, c.xyz);
  colour = vec4(a.w, b.w, c.w, d.w);
  if (shadow) { place -= sun * max(0.0, place.z - ground) / sun.z; place.z = ground; }
  gl_Position = eye * vec4(place, 1.0);
}`, `#version 300 es
precision highp float;
in vec3 n; in vec3 place; in vec4 colour;
uniform vec3 sun, from, shade; uniform bool shadow;
out vec4 seen;
void main() {
  if (shadow) { seen = vec4(shade, 1.0); return; }
  vec3 u = normalize(n), to = normalize(from - place);
  if (dot(u, to) < 0.0) u = -u;
  float lit = 0.52 + 0.13 * u.z + 0.38 * max(0.0, dot(u, -sun));
  float gloss = 0.12 * pow(max(0.0, dot(u, normalize(to - sun))), 24.0);
  seen = vec4(colour.rgb * lit + gloss, colour.a);
}`];

const GROUND = [`#version 300 es
layout(location=0) in vec3 point; uniform mat4 eye; uniform vec3 centre, size; out vec3 place;
void main() { place = centre + point * size; gl_Position = eye * vec4(place, 1.0); }`, `#version 300 es
precision highp float;
in vec3 place; uniform vec3 middle, base, line, sky; uniform float grid, reach; out vec4 seen;
float marks(float step) {
  vec2 at = place.xy / step, wide = max(fwidth(at), 1e-5);
  vec2 off = abs(fract(at - 0.5) - 0.5) / wide;
  return (1.0 - min(min(off.x, off.y), 1.0)) * (1.0 - smoothstep(0.1, 0.5, max(wide.x, wide.y)));
}
void main() {
  vec3 tone = mix(base, line, max(marks(grid), 0.35 * marks(grid / 5.0)));
  seen = vec4(mix(tone, sky, smoothstep(0.25, 1.0, length(place.xy - middle.xy) / reach)), 1.0);
}`];

class Renderer {
  constructor(canvas) {
    const gl = this.gl = canvas.getContext("webgl2", {antialias: true, preserveDrawingBuffer: true});
    if (!gl) throw new Error("This browser has no WebGL 2, which the picture needs.");
    this.solid = this.program(SOLID);
    this.floor = this.program(GROUND);
    this.shapes = {};
    this.add("ball", ballMesh());
    this.add("rod", rodMesh());
    this.add("block", blockMesh());
    this.sun = Vec.unit([0.30, 0.45, -1.0]);
  }

  program(sources) {
    const gl = this.gl, made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, sources[0]], [gl.FRAGMENT_SHADER, sources[1]]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    const at = {};
    for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
      const {name} = gl.getActiveUniform(made, i);
      at[name] = gl.getUniformLocation(made, name);
    }
    return {made, at};
  }

  add(name, {points, normals, faces}) {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    [points, normals].forEach((numbers, place) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(faces), gl.STATIC_DRAW);
    const copies = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, copies);
    for (let k = 0; k < 4; k++) {
      gl.enableVertexAttribArray(2 + k);
      gl.vertexAttribPointer(2 + k, 4, gl.FLOAT, false, 64, 16 * k);
      gl.vertexAttribDivisor(2 + k, 1);
    }
    gl.bindVertexArray(null);
    this.shapes[name] = {array, copies, count: faces.length, opaque: [], clear: []};
  }

  // a copy of a shape: columns of its rotation, half sizes, centre, colour
  put(name, columns, size, place, colour) {
    const rows = colour[3] < 1 ? this.shapes[name].clear : this.shapes[name].opaque;
    columns.forEach((column, i) => rows.push(column[0] * size[i], column[1] * size[i], column[2] * size[i], colour[i]));
    rows.push(place[0], place[1], place[2], colour[3]);
  }

  clear() { for (const shape of Object.values(this.shapes)) shape.opaque = [], shape.clear = []; }

  // `box`: x, y, width, height in pixels from below; `camera`: eye, right, up, towards, fovy; `floors`: planes
  draw(box, camera, floors, look, grid, reach) {
    const gl = this.gl, {solid, floor} = this;
    gl.viewport(...box);
    gl.scissor(...box);
    gl.enable(gl.SCISSOR_TEST);
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(...look.sky, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const eye = this.matrix(camera, box[2] / box[3], reach);
    gl.useProgram(floor.made);
    gl.uniformMatrix4fv(floor.at.eye, false, eye);
    for (const [name, value] of Object.entries({base: look.ground, line: look.line, sky: look.sky, middle: camera.target}))
      gl.uniform3fv(floor.at[name], value);
    gl.uniform1f(floor.at.grid, grid);
    gl.uniform1f(floor.at.reach, reach);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(2, 2);
    gl.bindVertexArray(this.shapes.block.array);
    gl.disableVertexAttribArray(2);
    for (const {centre, size} of floors) {
      gl.uniform3fv(floor.at.centre, [size[0] ? centre[0] : camera.target[0], size[1] ? centre[1] : camera.target[1], centre[2]]);
      gl.uniform3fv(floor.at.size, [size[0] || reach, size[1] || reach, 0]);
      gl.drawElements(gl.TRIANGLES, this.shapes.block.count, gl.UNSIGNED_INT, 0);
    }
    gl.enableVertexAttribArray(2);
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.useProgram(solid.made);
    gl.uniformMatrix4fv(solid.at.eye, false, eye);
    gl.uniform3fv(solid.at.sun, this.sun);
    gl.uniform3fv(solid.at.from, camera.eye);
    gl.uniform3fv(solid.at.shade, look.shade);
    this.copies("opaque");
    if (floors.length) {
      gl.uniform1i(solid.at.shadow, 1);
      gl.uniform1f(solid.at.ground, floors[0].centre[2]);
      this.copies("opaque");
    }
    gl.uniform1i(solid.at.shadow, 0);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    this.copies("clear");
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    gl.bindVertexArray(null);
    return eye;
  }

  copies(kind) {
    const gl = this.gl;
    for (const shape of Object.values(this.shapes)) {
      if (!shape[kind].length) continue;
      gl.bindVertexArray(shape.array);
      gl.bindBuffer(gl.ARRAY_BUFFER, shape.copies);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(shape[kind]), gl.DYNAMIC_DRAW);
      gl.drawElementsInstanced(gl.TRIANGLES, shape.count, gl.UNSIGNED_INT, 0, shape[kind].length / 16);
    }
  }

  matrix({eye, right, up, towards, fovy}, aspect, reach) {
    const f = 1 / Math.tan(fovy * Math.PI / 360), near = reach / 4000, far = 2 * reach;
    const rows = [Vec.mul(right, f / aspect), Vec.mul(up, f), Vec.mul(towards, -(far + near) / (near - far) * -1), Vec.mul(towards, -1)];
    const ends = rows.map(row => -Vec.dot(row, eye));
    ends[2] += 2 * far * near / (near - far);
    return new Float32Array([0, 1, 2].flatMap(i => rows.map(row => row[i])).concat(ends));
  }
}
