// The bed in 3D. Grains are quads that face the eye, on which a fragment shader draws spheres with their depth; contacts are ribbons
// shaded as cylinders. The camera is orthographic, so that both are exact. State: the inputs, kept in the URL's fragment.
"use strict";
(() => {
const data = JSON.parse(document.getElementById("data").textContent);
const packed = [...document.querySelectorAll("script.snapshot")];
const $ = id => document.getElementById(id);
const inputs = ["colour", "low", "high", "size", "cut", "fixed", "chains", "force", "water", "axis", "t", "pace"];
const [lx, ly] = data.box, n = data.count, last = packed.length - 1;

function problem(why) { $("problem").textContent = why; throw new Error(why); }
window.addEventListener("unhandledrejection", e => { $("problem").textContent = e.reason && e.reason.message || e.reason; });

// ---- snapshots, unpacked when they are first shown
async function unpack(k) {
  if (typeof DecompressionStream == "undefined") problem("This browser cannot unpack gzip (DecompressionStream); a newer one can.");
  const bytes = Uint8Array.from(atob(packed[k].textContent), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const raw = new Uint8Array(await new Response(stream).arrayBuffer());
  const found = {};
  let at = 0;
  for (const [name, length, width, low, step] of data.snapshots[k].columns) {
    const values = new Float32Array(length);
    for (let m = 0; m < length; ++m) {
      let whole = 0;
      for (let b = width - 1; b >= 0; --b) whole = whole * 256 + raw[at + b * length + m];
      values[m] = low + step * whole;
    }
    found[name] = values;
    at += length * width;
  }
  return found;
}
const kept = new Map();  // the latest shown
async function snapshot(k) {
  if (!kept.has(k)) kept.set(k, await unpack(k));
  const found = kept.get(k);
  kept.delete(k);
  kept.set(k, found);
  if (kept.size > 40) kept.delete(kept.keys().next().value);
  return found;
}

// ---- scene
const canvas = $("bed");
const gl = canvas.getContext("webgl2", {antialias: false});
if (!gl) problem("This browser shows no WebGL 2, which the bed is drawn with.");
const renderer = new THREE.WebGLRenderer({canvas, context: gl});
renderer.setClearColor(0xffffff, 1);
const scene = new THREE.Scene();
const camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0, 1);
camera.up.set(0, 0, 1);
const controls = new THREE.OrbitControls(camera, canvas);
const top_ = Math.max(...data.snapshots.map(s => s.top));
const middle = new THREE.Vector3(lx / 2, ly / 2, top_ / 2), reach = Math.hypot(lx, ly, top_);

function home() {
  const a = -28 * Math.PI / 180, e = 22 * Math.PI / 180;  // as in the figures
  camera.position.set(Math.sin(a) * Math.cos(e), -Math.cos(a) * Math.cos(e), Math.sin(e)).multiplyScalar(2 * reach).add(middle);
  camera.near = 0;
  camera.far = 4 * reach;
  camera.zoom = 1;
  controls.target.copy(middle);
  controls.update();
  resize();
}

function colours(name) {
  const map = data.colours[name], image = new Uint8Array(4 * map.length);
  map.forEach((c, k) => image.set([...c, 255], 4 * k));
  const texture = new THREE.DataTexture(image, map.length, 1, THREE.RGBAFormat);
  texture.magFilter = texture.minFilter = THREE.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
const maps = {plain: colours("plain"), signed: colours("signed")};
const uniforms = {map: {value: maps.plain}, size: {value: 1}, cut: {value: 0}};
const light = `
vec3 lit(vec3 colour, vec3 normal) {
  float shine = clamp(dot(normal, normalize(vec3(-0.45, 0.66, 0.6))), 0.0, 1.0);
  return colour * (0.38 + 0.67 * shine) + 0.25 * pow(shine, 24.0);
}`;

// `count` quads whose corners all have the attributes of their quad: {name: size}. Plain triangles; instances would each be a draw of its
// own in software.
function quads(count, attributes, vertex, fragment) {
  const geometry = new THREE.BufferGeometry(), corner = new Float32Array(12 * count), index = new Uint32Array(6 * count);
  for (let k = 0; k < count; ++k) {
    corner.set([-1, -1, 0, 1, -1, 0, -1, 1, 0, 1, 1, 0], 12 * k);
    index.set([0, 1, 2, 2, 1, 3].map(c => 4 * k + c), 6 * k);
  }
  geometry.setAttribute("position", new THREE.BufferAttribute(corner, 3));
  geometry.setIndex(new THREE.BufferAttribute(index, 1));
  for (const [name, size] of Object.entries(attributes)) {
    const attribute = new THREE.BufferAttribute(new Float32Array(4 * size * count), size);
    attribute.usage = 35048;  // dynamic
    geometry.setAttribute(name, attribute);
  }
  const material = new THREE.ShaderMaterial({uniforms, vertexShader: vertex, fragmentShader: fragment, side: THREE.DoubleSide,
                                             extensions: {fragDepth: true}});
  const mesh = new THREE.Mesh(geometry, material);
  mesh.frustumCulled = false;
  scene.add(mesh);
  return mesh;
}

const grains = quads(n, {at: 3, radius: 1, value: 1}, `
attribute vec3 at;
attribute float radius, value;
uniform float size, cut;
varying vec4 plane;  // of the cut: across it, and how far its place is from the centre, in radii
varying vec3 colour;
varying vec2 off, depth;  // depth: of the centre, and of a radius
uniform sampler2D map;
void main() {
  vec3 centre = (modelViewMatrix * vec4(at, 1.0)).xyz;
  off = position.xy;
  float r = radius * size;
  colour = value < 0.0 ? vec3(0.72) : texture2D(map, vec2(value, 0.5)).rgb;
  plane = vec4((viewMatrix * vec4(0.0, 1.0, 0.0, 0.0)).xyz, (cut - at.y) / r);
  gl_Position = projectionMatrix * vec4(centre + vec3(r * off, 0.0), 1.0);
  depth = 0.5 * projectionMatrix[2][2] * vec2(centre.z, r) + vec2(0.5 + 0.5 * projectionMatrix[3][2], 0.0);
  if (at.y + r < cut) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);  // out of sight
}`, `
varying vec4 plane;
varying vec3 colour;
varying vec2 off, depth;
${light}
void main() {
  float w2 = 1.0 - dot(off, off);
  if (w2 < 0.0) discard;
  vec3 normal = vec3(off, sqrt(w2));
  float w = normal.z;  // where the ray meets the grain, in radii from its centre towards the eye
  bool cut_ = dot(plane.xyz, normal) < plane.w;
  if (cut_) {  // what lies before the cut; the ray may go on to a disc in it
    if (plane.z > -1e-4) discard;
    w = (plane.w - dot(plane.xy, off)) / plane.z;
    if (abs(w) > normal.z) discard;
  }
  gl_FragColor = vec4(cut_ ? colour : lit(colour, normal), 1.0);
  gl_FragDepthEXT = depth.x + depth.y * w;
}`);

const most = Math.max(1, ...data.snapshots.map(s => s.columns.find(c => c[0] == "i")[1]));
const chains = quads(most, {a: 3, b: 3, thick: 1, value: 1}, `
attribute vec3 a, b;
attribute float thick, value;
varying float across, share, y;
void main() {
  vec3 p = (modelViewMatrix * vec4(a, 1.0)).xyz, q = (modelViewMatrix * vec4(b, 1.0)).xyz;
  vec2 along = q.xy - p.xy;
  vec2 side = vec2(-along.y, along.x) / max(length(along), 1e-9);
  across = position.x;
  share = value;
  float end = 0.5 + 0.5 * position.y;
  y = mix(a.y, b.y, end);
  gl_Position = projectionMatrix * vec4(mix(p, q, end) + vec3(thick * across * side, 0.0), 1.0);
}`, `
uniform sampler2D map;
uniform float cut;
varying float across, share, y;
${light}
void main() {
  if (y < cut) discard;
  gl_FragColor = vec4(lit(mix(vec3(0.95, 0.62, 0.35), vec3(0.55, 0.02, 0.1), share), vec3(0.0, across, sqrt(max(0.0, 1.0 - across * across)))), 1.0);
}`);

// The water's pressure in the vertical plane of the cut, one colour for each cell.
let slice = null;
if (data.water) {
  const material = new THREE.MeshBasicMaterial({side: THREE.DoubleSide, transparent: true, opacity: 0.75});
  slice = new THREE.Mesh(new (THREE.PlaneBufferGeometry || THREE.PlaneGeometry)(1, 1), material);
  slice.rotation.x = Math.PI / 2;
  scene.add(slice);
}

const edges = [], corner = k => [k & 1, k >> 1 & 1, k >> 2 & 1];  // of a unit cube
for (let k = 0; k < 8; ++k) for (const bit of [1, 2, 4]) if (!(k & bit)) edges.push(...corner(k), ...corner(k | bit));
const box = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({color: 0x555555}));
box.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(edges), 3));
scene.add(box);

// ---- what the inputs ask for
const number = id => parseFloat($(id).value);
const text = v => Math.abs(v) >= 1e6 || v && Math.abs(v) < 1e-3 ? v.toExponential(1) : String(+v.toPrecision(3));
let now = null, shown = -1;

function paint(canvas, map) {
  const c = canvas.getContext("2d");
  for (let k = 0; k < 256; ++k) {
    c.fillStyle = `rgb(${data.colours[map][Math.round(k / 255 * (data.colours[map].length - 1))]})`;
    c.fillRect(k, 0, 1, 1);
  }
}
function bar(id, field, low, high) {
  paint($(id ? id + "-colours" : "colours"), field.signed ? "signed" : "plain");
  $(id ? id + "-ticks" : "ticks").innerHTML = [0, 0.25, 0.5, 0.75, 1].map(s => `<span>${text(low + s * (high - low))}</span>`).join("");
  $(id ? id + "-label" : "label").textContent = field.label + (field.unit ? ` (${field.unit})` : "");
}

// Gives quad k of the mesh, at all its corners, the numbers that of(k) returns.
function set(mesh, name, count, of) {
  const attribute = mesh.geometry.getAttribute(name), size = attribute.itemSize;
  for (let k = 0; k < count; ++k) {
    const values = of(k);
    for (let c = 0; c < 4; ++c) for (let m = 0; m < size; ++m) attribute.array[(4 * k + c) * size + m] = values[m];
  }
  attribute.needsUpdate = true;
}

function recolour() {
  const field = data.fields[$("colour").value], low = number("low"), high = number("high"), grey = $("fixed").checked && $("colour").value != "role";
  uniforms.map.value = maps[field.signed ? "signed" : "plain"];
  const values = now[$("colour").value];
  set(grains, "value", n, k => [grey && now.role[k] > 0 ? -1 : Math.min(1, Math.max(0, (values[k] * field.factor - low) / (high - low || 1)))]);
  bar("", field, low, high);
}

function rechain() {
  const mean = data.snapshots[shown].mean_force, least = number("force") * mean;
  const r = now.radius.reduce((s, v) => s + v, 0) / n, strong = [];
  if ($("chains").checked) for (let k = 0; k < now.force.length; ++k) if (now.force[k] >= least) strong.push(k);
  const count = strong.length, i = k => now.i[strong[k]], j = k => now.j[strong[k]];
  const beyond = (from, to, side) => to - side * Math.round((to - from) / side);  // the image nearest across periodic sides
  set(chains, "a", count, k => [now.x[i(k)], now.y[i(k)], now.z[i(k)]]);
  set(chains, "b", count, k => [beyond(now.x[i(k)], now.x[j(k)], lx), beyond(now.y[i(k)], now.y[j(k)], ly), now.z[j(k)]]);
  set(chains, "thick", count, k => [Math.min(0.5, 0.11 * Math.sqrt(now.force[strong[k]] / mean)) * r]);
  set(chains, "value", count, k => [Math.min(1, now.force[strong[k]] / mean / 6)]);
  chains.geometry.setDrawRange(0, 6 * count);
  chains.visible = count > 0;
  $("chain-note").textContent = `${count} of ${data.snapshots[shown].contacts} contacts; light to dark: 0 to ${text(6 * mean)} N, six times the mean.`;
  $("chain-note").style.display = $("chains").checked ? "" : "none";
  return count;
}

function reslice() {
  const about = data.snapshots[shown], on = slice && $("water").checked && about.cells;
  $("water-bar").style.display = on ? "" : "none";
  if (!slice) return;
  slice.visible = Boolean(on);
  if (!on) return;
  const [nx, ny, nz] = about.cells, [sx, sy, sz] = about.size, y = number("cut");
  const row = Math.min(ny - 1, Math.floor(y / sy * ny)), [low, high] = data.water.range, map = data.colours.signed;
  const image = new Uint8Array(4 * nx * nz);
  for (let k = 0; k < nz; ++k) for (let i = 0; i < nx; ++i) {
    const share = (now.water[(k * ny + row) * nx + i] * data.water.factor - low) / (high - low);
    image.set([...map[Math.round(Math.min(1, Math.max(0, share)) * (map.length - 1))], 255], 4 * (k * nx + i));
  }
  if (slice.material.map) slice.material.map.dispose();
  const texture = slice.material.map = new THREE.DataTexture(image, nx, nz, THREE.RGBAFormat);
  texture.magFilter = texture.minFilter = THREE.NearestFilter;
  texture.needsUpdate = slice.material.needsUpdate = true;
  slice.scale.set(sx, sz, 1);
  slice.position.set(sx / 2, y - 0.02 * now.radius[0], sz / 2);  // just before the cut grains
  bar("water", data.water, low, high);
}

let asked = 0;
async function show(k) {
  const mine = ++asked, found = await snapshot(k);
  if (mine != asked) return;  // another has been asked for meanwhile
  now = found;
  shown = k;
  set(grains, "at", n, m => [now.x[m], now.y[m], now.z[m]]);
  set(grains, "radius", n, m => [now.radius[m]]);
  const about = data.snapshots[k];
  box.scale.set(lx, ly, about.top);
  $("caption").textContent = `stage ${data.stage}, t = ${about.time.toFixed(3)} s` + (about.strain === null ? "" : `, shear strain ${about.strain.toFixed(3)}`);
  $("grain").style.display = "none";
  refresh();
  mark();
}

function refresh() {
  uniforms.size.value = number("size");
  uniforms.cut.value = number("cut") > 0 ? number("cut") : -10 * reach;
  grains.visible = number("size") > 0;
  for (const id of ["size", "cut", "force"]) {
    const v = number(id), mean = now ? data.snapshots[shown].mean_force : 0;
    $(id).nextElementSibling.textContent = id == "size" ? `× ${v}` : id == "cut" ? (v > 0 ? `${(1e3 * v).toFixed(0)} mm` : "none") : `${text(v * mean)} N`;
  }
  if (now) {
    recolour();
    const count = rechain();
    reslice();
    document.body.dataset.state = JSON.stringify({shown, grains: n, contacts: count, colour: $("colour").value, first: [now.x[0], now.y[0], now.z[0]]});
  }
  const state = inputs.map(id => `${id}=${encodeURIComponent($(id).type == "checkbox" ? +$(id).checked : $(id).value)}`).join("&");
  try { history.replaceState(null, "", "#" + state); } catch (e) { /* some browsers refuse it to files */ }
  draw();
}

// ---- drawing: at once while things move, more coarsely where that takes long, and sharper when they rest
let waits = false, resting = 0, moving = window.devicePixelRatio, still = Math.max(2, moving);  // pixels of the canvas for one of the page
function paintBed(ratio) {
  renderer.setPixelRatio(ratio);
  const main = canvas.parentElement;
  renderer.setSize(main.clientWidth, main.clientHeight, false);
  renderer.render(scene, camera);
}
function draw() {
  if (waits) return;
  waits = true;
  requestAnimationFrame(() => {
    waits = false;
    paintBed(moving);
    clearTimeout(resting);
    resting = setTimeout(() => paintBed(still), 250);
  });
}
function resize() {
  const main = canvas.parentElement;
  const grow = Math.max(main.clientHeight, 1) / Math.max(main.clientWidth, 1);  // height over width
  const across = 0.88 * lx + 0.47 * ly, high = 0.93 * top_ + 0.37 * across;  // of the bed as home() sees it
  const half = Math.max(0.54 * across * grow, 0.66 * high);  // with room for what stands above and below
  camera.top = half;
  camera.bottom = -half;
  camera.right = half / grow;
  camera.left = -camera.right;
  camera.updateProjectionMatrix();
  paintBed(moving);  // before the browser shows the new size
  draw();
}
new ResizeObserver(resize).observe(canvas.parentElement);
controls.addEventListener("change", draw);

// ---- a click tells of a grain
let pressed = [0, 0];
canvas.addEventListener("pointerdown", e => { pressed = [e.clientX, e.clientY]; });
canvas.addEventListener("pointerup", e => {
  if (!now || Math.hypot(e.clientX - pressed[0], e.clientY - pressed[1]) > 4) return;
  const sides = canvas.getBoundingClientRect(), p = new THREE.Vector3();
  const u = 2 * (e.clientX - sides.left) / sides.width - 1, v = 1 - 2 * (e.clientY - sides.top) / sides.height;
  const perUnit = [2 * camera.zoom / (camera.right - camera.left), 2 * camera.zoom / (camera.top - camera.bottom)];
  let best = -1, nearest = Infinity;
  for (let k = 0; k < n; ++k) {
    if (now.y[k] < number("cut")) continue;
    p.set(now.x[k], now.y[k], now.z[k]).project(camera);
    const a = (p.x - u) / perUnit[0], b = (p.y - v) / perUnit[1], r = now.radius[k] * uniforms.size.value;
    const depth = p.z - Math.sqrt(Math.max(0, r * r - a * a - b * b)) * 2 / (camera.far - camera.near);
    if (a * a + b * b < r * r && depth < nearest) [best, nearest] = [k, depth];
  }
  $("grain").style.display = best < 0 ? "none" : "block";
  if (best < 0) return;
  $("grain").style.left = `${Math.min(e.clientX - sides.left + 10, sides.width - 230)}px`;
  $("grain").style.top = `${Math.min(e.clientY - sides.top + 10, sides.height - 190)}px`;
  $("grain").textContent = [`grain in row ${best}`, `centre ${["x", "y", "z"].map(q => (1e3 * now[q][best]).toFixed(1)).join(", ")} mm`]
    .concat(Object.entries(data.fields).map(([name, f]) => name == "role" ? `role ${now.role[best]} (${f.label})` : `${f.label} ${text(now[name][best] * f.factor)} ${f.unit}`)).join("\n");
});

// ---- curves
const panels = [];
function curve(label, values) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 300 108");
  svg.setAttribute("preserveAspectRatio", "none");
  $("curves").append(svg);
  panels.push({svg, label, values});
}
function plot() {
  const x = data.series.x[$("axis").value], left = 44, right = 294, over = 17, under = 92;
  const x0 = Math.min(...x), x1 = Math.max(...x);
  const place = v => left + (right - left) * (v - x0) / (x1 - x0 || 1);
  for (const {svg, label, values} of panels) {
    const some = values.filter(v => v !== null), y0 = Math.min(...some), y1 = Math.max(...some);
    const height = v => under - (under - over) * (v - y0) / (y1 - y0 || 1);
    let path = "", pen = "M";
    values.forEach((v, k) => { if (v === null) { pen = "M"; return; } path += `${pen}${place(x[k]).toFixed(1)} ${height(v).toFixed(1)}`; pen = "L"; });
    svg.innerHTML = `<text x="${left}" y="10">${label}</text><path d="M${left} ${over}V${under}H${right}" fill="none" stroke="#888"/>
      <path d="${path}" fill="none" stroke="#31688e" vector-effect="non-scaling-stroke"/><line class="now" y1="${over}" y2="${under}" stroke="#c33"/>
      <text x="${left - 4}" y="${over + 8}" text-anchor="end">${text(y1)}</text><text x="${left - 4}" y="${under}" text-anchor="end">${text(y0)}</text>
      <text x="${left}" y="104">${text(x0)}</text><text x="${right}" y="104" text-anchor="end">${text(x1)}</text><text x="170" y="104" text-anchor="middle">${$("axis").value}</text>`;
  }
  mark();
}
const when = s => $("axis").value == "shear strain" ? s.strain : s.time;
function mark() {
  if (shown < 0) return;
  const x = data.series.x[$("axis").value], x0 = Math.min(...x), x1 = Math.max(...x), at = 44 + 250 * (when(data.snapshots[shown]) - x0) / (x1 - x0 || 1);
  for (const {svg} of panels) for (const line of svg.querySelectorAll(".now")) { line.setAttribute("x1", at); line.setAttribute("x2", at); }
}
$("curves").addEventListener("click", e => {  // on a curve: the snapshot nearest to that place
  const svg = e.target.closest("svg");
  if (!svg) return;
  const x = data.series.x[$("axis").value], sides = svg.getBoundingClientRect(), share = ((e.clientX - sides.left) / sides.width * 300 - 44) / 250;
  const at = Math.min(...x) + share * (Math.max(...x) - Math.min(...x));
  const off = data.snapshots.map(s => Math.abs(when(s) - at));
  $("t").value = off.indexOf(Math.min(...off));
  show(number("t"));
});

// ---- playing
let playing = false;
async function play() {
  playing = !playing;
  $("play").innerHTML = playing ? "&#10074;&#10074;" : "&#9654;";
  while (playing) {
    const due = performance.now() + 1000 / Math.max(1, number("pace"));
    $("t").value = shown >= last ? 0 : shown + 1;
    await show(number("t"));
    await new Promise(done => setTimeout(done, Math.max(0, due - performance.now())));
  }
}
$("play").addEventListener("click", play);
window.addEventListener("keydown", e => {
  if (["INPUT", "SELECT", "BUTTON"].includes(e.target.tagName) && e.target.type != "range") return;
  if (e.key == " ") { e.preventDefault(); play(); }
});

// Frames a second of turning the bed, each one waited for.
window.measure = (frames = 10, ratio = window.devicePixelRatio) => {
  const pixel = new Uint8Array(4), from = camera.position.clone();
  let began = 0;
  for (let k = 0; k <= frames; ++k) {  // the first is not counted: shaders are compiled in it
    camera.position.sub(middle).applyAxisAngle(camera.up, 0.02).add(middle);
    camera.lookAt(middle);
    paintBed(ratio);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    began = began || performance.now();
  }
  const rate = 1000 * frames / (performance.now() - began);
  camera.position.copy(from);
  controls.update();
  draw();
  return rate;
};
function adapt() {
  const full = window.devicePixelRatio, rate = measure(1);
  moving = full * Math.min(1, Math.max(0.25, Math.sqrt(rate / 20)));
  still = moving < full ? full : Math.max(2, full);
}

// ---- begin
for (const [name, field] of Object.entries(data.fields)) $("colour").add(new Option(field.label, name));
for (const name of Object.keys(data.series.x)) $("axis").add(new Option(name, name));
for (const [label, values] of Object.entries(data.series.curves)) curve(label, values);
$("title").textContent = data.title;
$("left-out").textContent = `Not in this page: ${data.left_out}.` + (data.series.every > 1 ? ` Curves: every ${data.series.every}th row.` : "") +
  " Numbers are rounded to 1/65535 of their range in each snapshot.";
$("cut").max = ly;
$("cut").step = ly / 200;
$("t").max = last;
$("water-row").style.display = slice ? "" : "none";
const defaults = {colour: "pressure", low: "", high: "", size: 1, cut: 0, fixed: 1, chains: 0, force: 2, water: 0, axis: $("axis").options[$("axis").options.length - 1].value, t: last, pace: 10};
function range() { [$("low").value, $("high").value] = data.fields[$("colour").value].range.map(text); }
const given = Object.assign(defaults, Object.fromEntries(new URLSearchParams(location.hash.slice(1))));
for (const id of inputs) $(id).type == "checkbox" ? $(id).checked = +given[id] : $(id).value = given[id];
if (!data.fields[$("colour").value]) $("colour").value = "pressure";
if (given.low === "" || given.high === "") range();
for (const id of inputs) $(id).addEventListener($(id).type == "range" || $(id).type == "number" ? "input" : "change", () => {
  if (id == "t") return void show(number("t"));
  if (id == "axis") plot();
  if (id == "colour") range();
  if (id == "chains" && $("chains").checked && number("size") == 1) $("size").value = 0.3;  // or the grains would hide them
  if (id == "water" && $("water").checked && number("cut") == 0) $("cut").value = ly / 2;
  refresh();
});
$("home").addEventListener("click", home);
home();
plot();
show(number("t")).then(adapt);
})();
