// The page of `viewfuse view`: the novel view's camera follows the hand; pictures and weights come from the program.
//
//   vectors, poses      a pose is { right, down, forward, centre }: camera axes (OpenCV) and centre in the world
//   colours             viridis
//   server              what is asked, newest first
//   picture, map        what is drawn
//   sources, settings   bars, menus, buttons
//   hand                pointers, wheel, keys
'use strict';

// ---------------------------------------------------------------- vectors

const add = (a, b) => a.map((x, i) => x + b[i]);
const sub = (a, b) => a.map((x, i) => x - b[i]);
const times = (a, s) => a.map((x) => x * s);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length = (a) => Math.hypot(...a);
const unit = (a) => times(a, 1 / (length(a) || 1));
const clamp = (x, least, most) => Math.min(most, Math.max(least, x));

// `a` turned around a unit axis (Rodrigues).
function turned(a, axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return add(add(times(a, c), times(cross(axis, a), s)), times(axis, dot(axis, a) * (1 - c)));
}

// ---------------------------------------------------------------- poses

function poseOf(m) {
  const column = (i) => [m[0][i], m[1][i], m[2][i]];
  return { right: column(0), down: column(1), forward: column(2), centre: column(3) };
}

// World from camera, row-major.
function matrixOf({ right: r, down: d, forward: f, centre: c }) {
  return [0, 1, 2].map((i) => [r[i], d[i], f[i], c[i]]).concat([[0, 0, 0, 1]]);
}

// The same pose with axes that are orthonormal again.
function straight({ right, down, forward, centre }) {
  const ahead = unit(forward);
  const across = unit(cross(down, ahead));
  return { right: across, down: cross(ahead, across), forward: ahead, centre };
}

// The pose turned around an axis through a point.
function turnedPose(pose, point, axis, angle) {
  const turn = (a) => turned(a, axis, angle);
  const { right, down, forward, centre } = pose;
  return straight({
    right: turn(right), down: turn(down), forward: turn(forward), centre: add(point, turn(sub(centre, point))),
  });
}

function lookAt(centre, point, up) {
  const forward = unit(sub(point, centre));
  const right = unit(cross(forward, up));
  return { right, down: cross(forward, right), forward, centre };
}

// A world point in camera axes.
function inCamera(pose, point) {
  const offset = sub(point, pose.centre);
  return [dot(pose.right, offset), dot(pose.down, offset), dot(pose.forward, offset)];
}

// ---------------------------------------------------------------- colours

// Viridis at 16 even places.
const VIRIDIS = ['440154', '481a6c', '472f7d', '414487', '39568c', '31688e', '2a788e', '23888e', '1f988b', '22a884',
  '35b779', '54c568', '7ad151', 'a5db36', 'd2e21b', 'fde725']
  .map((hex) => [0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16)));

function colourOf(share) {
  const place = clamp(share, 0, 1) * (VIRIDIS.length - 1);
  const below = Math.min(Math.floor(place), VIRIDIS.length - 2);
  const mix = place - below;
  return VIRIDIS[below].map((low, i) => Math.round(low + mix * (VIRIDIS[below + 1][i] - low)));
}

const css = (share, alpha = 1) => `rgb(${colourOf(share).join(' ')} / ${alpha})`;
const LEVELS = Array.from({ length: 256 }, (_, level) => colourOf(level / 255));

function drawScale(canvas) {
  const context = canvas.getContext('2d');
  for (let x = 0; x < canvas.width; x += 1) {
    context.fillStyle = css(x / (canvas.width - 1));
    context.fillRect(x, 0, 1, 1);
  }
}

// ---------------------------------------------------------------- state

const element = (id) => document.getElementById(id);
const tab = Array.from(crypto.getRandomValues(new Uint32Array(3)), (x) => x.toString(36)).join('');

let scene = null;            // what the program says of it
let pose = null;             // the novel view's camera
let focus = null;            // what it turns around
let weights = [];            // of the sources, for `pose` or a pose shortly before
let scheme = '';
let layer = 'none';
let shown = null;            // { pose, bitmap, size, layer } of the picture on the screen
let observer = null;         // the camera of the map

const REST = 200;            // milliseconds without a change after which the hand rests
const COARSE_SIDE = 160;     // pixels
const TURN = Math.PI * 0.75; // radians for the width of the picture
const STEP = Math.PI / 60;   // radians for a key
const TOP = 0.05;            // radians that are kept from the pole

// ---------------------------------------------------------------- server

async function post(path, body) {
  const response = await fetch(path, {
    method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(body),
  });
  if (response.status === 204) return null;
  if (!response.ok) throw new Error(await response.text());
  return response;
}

function told(error) {
  const problem = element('problem');
  problem.hidden = error === null;
  if (error === null) return;
  const isGone = error instanceof TypeError;
  problem.textContent = isGone ? 'The program does not answer: was it ended?' : error.message;
}

let asked = 0;               // numbers of requests
let drawn = 0;               // the newest request that was drawn
let isCoarseOut = false;     // a coarse picture is on its way
let isCoarseWanted = false;
let fullOut = 0;             // requests for full pictures that wait
let restTimer = 0;

// `arrived` is called once the program has answered: it can do the next picture while this one is drawn.
async function askPicture(moving, arrived) {
  asked += 1;
  const number = asked;
  const at = pose;
  const body = { tab, pose: matrixOf(at), scheme, layer, moving };
  if (moving) body.side = COARSE_SIDE;
  try {
    const response = await post('picture', body);
    if (response === null) return;
    const bytes = await response.arrayBuffer();
    arrived();
    const answer = await unpacked(bytes);
    told(null);
    if (number < drawn) {
      release(answer);
      return;
    }
    drawn = number;
    release(shown);
    shown = { pose: at, ...answer };
    tellWeights(answer.weights, number);
    drawPicture();
    tellStatus(answer);
  } catch (error) {
    told(error);
  }
}

// The memory of a picture that is replaced: the browser would keep it for a while.
function release(old) {
  if (old === null) return;
  old.bitmap.close();
  if (old.layer) old.layer.bitmap.close();
}

// 4 bytes length of the JSON, the JSON, the picture, the layer.
async function unpacked(buffer) {
  const start = 4 + new DataView(buffer).getUint32(0, true);
  const answer = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, start - 4)));
  const end = start + answer.picture.bytes;
  const blob = new Blob([buffer.slice(start, end)], { type: answer.picture.media_type });
  answer.bitmap = await createImageBitmap(blob);
  if (answer.layer) answer.layer.bitmap = await coloured(answer.size, new Uint8Array(buffer, end), answer.layer.has_gaps);
  return answer;
}

// Levels of one byte as colours; level 0 may mean that nothing is there.
function coloured([width, height], levels, hasGaps) {
  const image = new ImageData(width, height);
  levels.forEach((level, i) => {
    const isGap = hasGaps && level === 0;
    image.data.set(isGap ? [0, 0, 0, 255] : [...LEVELS[level], 255], 4 * i);
  });
  return createImageBitmap(image);
}

async function pumpCoarse() {
  if (isCoarseOut || !isCoarseWanted) return;
  isCoarseOut = true;
  isCoarseWanted = false;
  const next = () => { isCoarseOut = false; pumpCoarse(); };
  let hasArrived = false;
  await askPicture(true, () => { hasArrived = true; next(); });
  if (!hasArrived) next();
}

async function askFull() {
  if (isCoarseOut || isCoarseWanted) {
    restTimer = setTimeout(askFull, 50);
    return;
  }
  fullOut += 1;
  await askPicture(false, () => {});
  fullOut -= 1;
}

let isWeightsOut = false;
let areWeightsWanted = false;

// Weights take no rendering, so that they follow the hand also where pictures are slow.
async function pumpWeights() {
  if (isWeightsOut || !areWeightsWanted) return;
  isWeightsOut = true;
  areWeightsWanted = false;
  asked += 1;
  const number = asked;
  try {
    const response = await post('weights', { tab, pose: matrixOf(pose), scheme });
    tellWeights(await response.json(), number);
  } catch (error) {
    told(error);
  }
  isWeightsOut = false;
  pumpWeights();
}

// The view or what it is made of has changed.
function changed() {
  isCoarseWanted = true;
  areWeightsWanted = true;
  pumpCoarse();
  pumpWeights();
  clearTimeout(restTimer);
  restTimer = setTimeout(askFull, REST);
  tellCommand();
  drawMapSoon();
}

// While something is waited for, what the program does.
async function watch() {
  if (shown === null || fullOut > 0) {
    try {
      const status = await (await fetch('status')).json();
      tellWork(status);
    } catch { /* told by the request for the picture */ }
  }
  setTimeout(watch, 400);
}

function tellWork({ stage, done, pieces, warnings }) {
  const text = stage === '' ? '' : `${stage}${pieces > 0 ? `: ${Math.min(done, pieces)} of ${pieces}` : ''} …`;
  if (shown === null) element('waiting').textContent = text || 'Reading the scene';
  else if (!shown.full && text !== '') element('status').textContent = `coarse; ${text}`;
  element('warnings').replaceChildren(...warnings.map((warning) => {
    const item = document.createElement('li');
    item.textContent = warning;
    return item;
  }));
}

// ---------------------------------------------------------------- picture

// A canvas as large as it is on the screen, in the screen's own pixels.
function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * ratio)));
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const context = canvas.getContext('2d', { willReadFrequently: false });
  context.setTransform(1, 0, 0, 1, 0, 0);
  return { context, width, height, ratio };
}

function drawPicture() {
  if (shown === null) return;
  element('waiting').hidden = true;
  const canvas = element('picture');
  const { context, width, height, ratio } = fitted(canvas);
  const [own, tall] = scene.size;
  const scale = Math.min(width / own, height / tall);
  const [left, top] = [(width - own * scale) / 2, (height - tall * scale) / 2];
  context.fillStyle = '#000';
  context.fillRect(0, 0, width, height);
  context.imageSmoothingQuality = 'high';
  context.drawImage(shown.bitmap, left, top, own * scale, tall * scale);
  if (shown.layer) {
    context.globalAlpha = element('strength').value / 100;
    context.drawImage(shown.layer.bitmap, left, top, own * scale, tall * scale);
    context.globalAlpha = 1;
  }
  if (element('overlay').checked) {
    context.save();
    context.beginPath();
    context.rect(left, top, own * scale, tall * scale);
    context.clip();
    const { focal, principal } = scene.lens;
    const project = ([x, y, z]) => [left + scale * (focal[0] * x / z + principal[0]), top + scale * (focal[1] * y / z + principal[1])];
    drawSources(context, shown.pose, project, ratio, shown.weights, false);
    context.restore();
  }
  tellLayer();
  canvas.dataset.pictures = Number(canvas.dataset.pictures || 0) + 1;
  canvas.dataset.kind = shown.full ? 'full' : 'coarse';
  canvas.dataset.size = shown.size.join('x');
}

const recent = [];           // when the last coarse pictures were drawn

function tellStatus({ full, size, seconds }) {
  const time = seconds < 1 ? `${Math.round(1000 * seconds)} ms` : `${seconds.toFixed(1)} s`;
  element('status').textContent = `${full ? 'full' : 'coarse'}, ${size.join(' × ')}, ${time}`;
  const now = performance.now();
  if (!full) recent.push(now);
  while (recent.length > 0 && recent[0] < now - 2000) recent.shift();
  const span = recent.length > 4 ? (recent.at(-1) - recent[0]) / 1000 : 0;
  element('rate').textContent = span > 0 && !full ? `${((recent.length - 1) / span).toFixed(0)} pictures a second` : '';
}

// ---------------------------------------------------------------- frusta

// The centre and the corners of a camera's image, at a depth.
function frustum({ pose: own, lens }, depth) {
  const corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(([x, y]) => {
    const across = (x * lens.size[0] - lens.principal[0]) / lens.focal[0];
    const below = (y * lens.size[1] - lens.principal[1]) / lens.focal[1];
    const towards = add(add(own.forward, times(own.right, across)), times(own.down, below));
    return add(own.centre, times(towards, depth));
  });
  return [own.centre, ...corners];
}

const EDGES = [[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1]];
const NEAR = 1e-3;

// A frustum as lines, cut where it is behind the eye.
function drawFrustum(context, eye, project, points, colour, width) {
  const seen = points.map((point) => inCamera(eye, point));
  const near = NEAR * scene.distance;
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.beginPath();
  for (const [from, to] of EDGES) {
    let [a, b] = [seen[from], seen[to]];
    if (a[2] < near && b[2] < near) continue;
    if (a[2] < near || b[2] < near) {
      const share = (near - a[2]) / (b[2] - a[2]);
      const cut = add(a, times(sub(b, a), share));
      if (a[2] < near) a = cut; else b = cut;
    }
    context.moveTo(...project(a));
    context.lineTo(...project(b));
  }
  context.stroke();
  return seen;
}

// The source cameras, the greatest weights last. `own` are their weights.
function drawSources(context, eye, project, ratio, own, isMap) {
  const most = Math.max(...own, 1e-9);
  const order = own.map((_, i) => i).sort((a, b) => own[a] - own[b]);
  const tips = order.map((i) => {
    const share = own[i] / most;
    const source = scene.sources[i];
    // In the picture, cameras beside the eye would cover everything and show nothing.
    if (!isMap && inCamera(eye, source.pose.centre)[2] < 0.1 * scene.distance) return null;
    return drawFrustum(context, eye, project, frustum(source, scene.frustum), css(share), (1 + 2 * share) * ratio)[0];
  });
  if (!isMap) return;
  // Names, of the greatest weights first, where they do not cover one another.
  const style = getComputedStyle(document.body);
  const taken = [];
  for (const place of order.keys()) {
    const at = order.length - 1 - place;
    const { name } = scene.sources[order[at]];
    if (tips[at][2] <= 0) continue;
    const [x, y] = project(tips[at]);
    const box = [x - context.measureText(name).width / 2, y + 16 * ratio, context.measureText(name).width, 14 * ratio];
    if (taken.some((other) => Math.abs(other[0] + other[2] / 2 - box[0] - box[2] / 2) < (other[2] + box[2]) / 2 + 4 * ratio
      && Math.abs(other[1] - box[1]) < box[3])) continue;
    taken.push(box);
    context.lineWidth = 3 * ratio;
    context.strokeStyle = style.getPropertyValue('--card');
    context.strokeText(name, box[0], box[1]);
    context.fillStyle = style.color;
    context.fillText(name, box[0], box[1]);
  }
}

// ---------------------------------------------------------------- map

// How the map's camera projects, for a canvas of this size.
function mapProjection(width, height) {
  const focal = 1.6 * height;
  return ([x, y, z]) => [width / 2 + focal * x / z, height / 2 + focal * y / z];
}

// From behind and above the middle of the cameras, far enough to see all of them and the subject.
function firstObserver() {
  const centres = scene.sources.map((source) => source.pose.centre);
  const level = (a) => sub(a, times(scene.up, dot(a, scene.up)));
  let away = level(sub(times(centres.reduce(add), 1 / centres.length), scene.focus));
  if (length(away) < 0.2 * scene.distance) away = level(sub(scene.start.centre, scene.focus));
  const side = unit(cross(scene.up, away));
  const direction = turned(turned(unit(away), side, -0.75), scene.up, 0.3);
  const all = [scene.focus, ...scene.sources.flatMap((source) => frustum(source, scene.frustum))];
  const ends = [0, 1, 2].map((i) => [Math.min, Math.max].map((end) => end(...all.map((point) => point[i]))));
  const target = ends.map(([least, most]) => (least + most) / 2);
  const { clientWidth: width, clientHeight: height } = element('map');
  const project = mapProjection(width, height);
  const seen = (distance) => {
    const own = lookAt(add(target, times(direction, distance)), target, scene.up);
    const fits = all.map((point) => inCamera(own, point)).every((point) => {
      const [x, y] = project(point);
      return point[2] > 0 && x > 0.06 * width && x < 0.94 * width && y > 0.1 * height && y < 0.92 * height;
    });
    return fits ? own : null;
  };
  for (let distance = 0.5 * scene.distance; distance < 100 * scene.distance; distance *= 1.05) {
    const own = seen(distance);
    if (own !== null) return { target, pose: own };
  }
  return { target, pose: lookAt(add(target, times(direction, 4 * scene.distance)), target, scene.up) };
}

let isMapDue = false;

// Once for each picture of the screen, however often something changes.
function drawMapSoon() {
  if (isMapDue) return;
  isMapDue = true;
  requestAnimationFrame(() => { isMapDue = false; drawMap(); });
}

function drawMap() {
  if (scene === null) return;
  const canvas = element('map');
  const { context, width, height, ratio } = fitted(canvas);
  const style = getComputedStyle(document.body);
  context.clearRect(0, 0, width, height);
  const project = mapProjection(width, height);
  // From farther away while the novel view's camera would be out of sight.
  let eye = observer.pose;
  for (let i = 0; i < 60; i += 1) {
    const tip = inCamera(eye, pose.centre);
    const [x, y] = project(tip);
    if (tip[2] > 0 && x > 0.03 * width && x < 0.97 * width && y > 0.03 * height && y < 0.97 * height) break;
    eye = { ...eye, centre: add(observer.target, times(sub(eye.centre, observer.target), 1.05)) };
  }
  context.font = `${12 * ratio}px system-ui, sans-serif`;

  // A ring around the focus, so that the ground can be told.
  const side = unit(cross(scene.up, eye.forward));
  const ahead = cross(side, scene.up);
  context.beginPath();
  for (let i = 0; i <= 48; i += 1) {
    const angle = i / 24 * Math.PI;
    const point = add(focus, times(add(times(side, Math.cos(angle)), times(ahead, Math.sin(angle))), 0.2 * scene.distance));
    const [x, y] = project(inCamera(eye, point));
    if (i === 0) context.moveTo(x, y); else context.lineTo(x, y);
  }
  const axis = [focus, add(focus, times(scene.up, 0.15 * scene.distance))].map((point) => project(inCamera(eye, point)));
  context.moveTo(...axis[0]);
  context.lineTo(...axis[1]);
  context.strokeStyle = style.getPropertyValue('--faint');
  context.lineWidth = ratio;
  context.stroke();
  context.fillStyle = style.getPropertyValue('--faint');
  context.fillText('subject', axis[1][0] + 5 * ratio, axis[1][1]);

  drawSources(context, eye, project, ratio, weights.length > 0 ? weights : scene.sources.map(() => 0), true);
  const accent = style.getPropertyValue('--accent');
  drawFrustum(context, eye, project, frustum({ pose, lens: scene.lens }, 1.5 * scene.frustum), accent, 2.5 * ratio);
  const line = [pose.centre, focus].map((point) => inCamera(eye, point));
  if (line.every((point) => point[2] > 0)) {
    context.setLineDash([4 * ratio, 4 * ratio]);
    context.lineWidth = ratio;
    context.beginPath();
    context.moveTo(...project(line[0]));
    context.lineTo(...project(line[1]));
    context.stroke();
    context.setLineDash([]);
  }
}

// ---------------------------------------------------------------- sources

function showSources() {
  element('sources').replaceChildren(...scene.sources.map((source, i) => {
    const item = document.createElement('li');
    const button = document.createElement('button');
    const image = document.createElement('img');
    const name = document.createElement('span');
    const label = document.createElement('b');
    const value = document.createElement('output');
    const bar = document.createElement('div');
    button.type = 'button';
    button.title = `Go to the camera of ${source.name}`;
    image.alt = `Photograph ${source.name}`;
    name.className = 'name';
    label.textContent = source.name;
    bar.className = 'bar';
    bar.append(document.createElement('span'));
    name.append(label, value);
    button.append(image, name, bar);
    button.addEventListener('click', () => goTo(source.pose));
    item.append(button);
    source.parts = { image, value, bar: bar.firstChild, number: i };
    return item;
  }));
}

// Photographs are there as soon as a picture is.
function showPhotographs() {
  for (const { parts } of scene.sources) parts.image.src = `source/${parts.number}`;
}

let weighed = 0;             // the newest request whose weights are shown

function tellWeights(own, number) {
  if (number < weighed) return;
  weighed = number;
  weights = own;
  const most = Math.max(...own, 1e-9);
  own.forEach((weight, i) => {
    const { value, bar } = scene.sources[i].parts;
    value.textContent = `${(100 * weight).toFixed(1)} %`;
    value.dataset.weight = weight;
    bar.style.width = `${100 * weight / most}%`;
    bar.style.background = css(weight / most);
  });
  element('sum').textContent = own.reduce((a, b) => a + b, 0).toFixed(3);
  element('most').textContent = `${(100 * most).toFixed(0)} %`;
  drawMapSoon();
}

// ---------------------------------------------------------------- settings

const isWhole = (row) => !row.parameter && !row.choice;

function showSchemes() {
  const menu = element('scheme');
  const [name] = scene.scheme.split(':');
  const isKnown = scene.schemes.some((row) => row.name === name);
  const names = scene.schemes.map((row) => row.name).concat(isKnown ? [] : [scene.scheme]);
  menu.replaceChildren(...names.map((own) => new Option(own, own)));
  menu.value = isKnown ? name : scene.scheme;
  chooseScheme();
  // The values that the program was started with.
  const given = new Map((scene.scheme.split(':')[1] || '').split(',').map((pair) => pair.split('=')));
  const row = rowOf(menu.value);
  if (row && row.choice && given.has(row.choice.key)) element('choice').value = given.get(row.choice.key);
  if (row && row.parameter && given.has(row.parameter.key)) {
    element('parameter').value = placeOf(row.parameter, Number(given.get(row.parameter.key)));
  }
  schemeText();
  scheme = scene.scheme;
}

const rowOf = (name) => scene.schemes.find((row) => row.name === name);

// A slider has 1000 steps; without a limit it goes over four decades around the default.
function valueOf({ least, most, default: usual }, place) {
  const value = most === null ? usual * 10 ** (place / 250 - 2) : least + (most - least) * place / 1000;
  return Number(value.toPrecision(3));
}

function placeOf({ least, most, default: usual }, value) {
  const place = most === null ? 250 * (2 + Math.log10(Math.max(value, 1e-30) / usual)) : 1000 * (value - least) / (most - least);
  return Math.round(clamp(place, 0, 1000));
}

function chooseScheme() {
  const row = rowOf(element('scheme').value);
  element('choice-row').hidden = !row || !row.choice;
  element('parameter-row').hidden = !row || !row.parameter;
  if (row && row.choice) {
    element('choice-name').textContent = row.choice.key;
    element('choice').replaceChildren(...row.choice.options.map((option) => new Option(option, option)));
  }
  if (row && row.parameter) {
    element('parameter-name').textContent = row.parameter.key;
    element('parameter').value = placeOf(row.parameter, row.parameter.default);
  }
}

// What the menu, the choice and the slider say, as on the command line.
function schemeText() {
  const name = element('scheme').value;
  const row = rowOf(name);
  if (!row || isWhole(row)) return name;
  const pairs = [];
  if (row.parameter) {
    const value = valueOf(row.parameter, Number(element('parameter').value));
    element('parameter-value').textContent = value;
    pairs.push(`${row.parameter.key}=${value}`);
  }
  if (row.choice && element('choice').value !== row.choice.options[0]) pairs.push(`${row.choice.key}=${element('choice').value}`);
  return pairs.length > 0 ? `${name}:${pairs.join(',')}` : name;
}

function schemeChanged() {
  scheme = schemeText();
  changed();
}

function tellLayer() {
  const own = shown && shown.layer;
  element('strength-row').hidden = !own;
  element('layer-legend').hidden = !own;
  if (shown) {
    for (const input of document.querySelectorAll('input[name="layer"]')) {
      input.disabled = input.value !== 'none' && !shown.layers.includes(input.value);
    }
  }
  if (!own) return;
  const [least, most] = own.range.map((value) => Number(value.toPrecision(3)));
  element('layer-least').textContent = own.kind === 'depth' ? `near ${least}` : 'unsure';
  element('layer-most').textContent = own.kind === 'depth' ? `far ${most}` : 'sure';
}

// ---------------------------------------------------------------- elsewhere

const FILE = 'view.json';

// In the coordinates of the scene's files, OpenGL axes, as NeRF's transforms.json.
function transforms() {
  const { right, down, forward, centre } = pose;
  const place = centre.map((x, i) => scene.origin[i] + scene.scale * x);
  const rows = [0, 1, 2].map((i) => [right[i], 0 - down[i], 0 - forward[i], place[i]]).concat([[0, 0, 0, 1]]);
  const { focal, principal, size } = scene.lens;
  return {
    camera_model: 'PINHOLE',
    w: size[0], h: size[1], fl_x: focal[0], fl_y: focal[1], cx: principal[0], cy: principal[1],
    frames: [{ file_path: 'view', transform_matrix: rows }],
  };
}

function command() {
  const { render, options, first_weights: first } = scene.commands;
  if (render === '') return '';
  // Words for a shell come from the program; a scheme of the menu has none that needs quotes.
  const weights = scheme === scene.scheme ? first : scheme;
  const matrix = JSON.stringify(matrixOf(pose));
  const own = scene.others.find((other) => JSON.stringify(matrixOf(other.pose)) === matrix);
  const target = own ? `--targets ${own.word}` : `--camera-path ${FILE}`;
  return `${render} ${target}${options} --weights ${weights} -o out`;
}

function tellCommand() {
  element('command').textContent = command();
}

function said(text) {
  element('said').textContent = text;
}

function save() {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(new Blob([`${JSON.stringify(transforms(), null, 2)}\n`], { type: 'application/json' }));
  link.download = FILE;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  said(`Saved as ${FILE}.`);
}

async function copy() {
  try {
    await navigator.clipboard.writeText(command());
    said(command().includes(FILE) ? `Copied. It reads ${FILE}: save the view as well.` : 'Copied.');
  } catch {
    getSelection().selectAllChildren(element('command'));
    said('The browser does not allow copying: the line is selected.');
  }
}

// ---------------------------------------------------------------- hand

function goTo(own) {
  pose = own;
  changed();
}

function orbit(around, above) {
  const turnedAround = turnedPose(pose, focus, scene.up, around);
  const offset = sub(turnedAround.centre, focus);
  const height = Math.acos(clamp(dot(unit(offset), scene.up), -1, 1));
  // Not over the pole.
  const angle = clamp(height - above, TOP, Math.PI - TOP) - height;
  const axis = unit(cross(scene.up, offset));
  pose = length(cross(scene.up, offset)) > 1e-6 ? turnedPose(turnedAround, focus, axis, angle) : turnedAround;
  changed();
}

function move(factor) {
  const offset = sub(pose.centre, focus);
  const distance = clamp(length(offset) * factor, 0.05 * scene.distance, 20 * scene.distance);
  pose = { ...pose, centre: add(focus, times(unit(offset), distance)) };
  changed();
}

// Sideways, in shares of the picture's width.
function pan(across, below) {
  const distance = length(sub(pose.centre, focus));
  const width = distance * scene.lens.size[0] / scene.lens.focal[0];
  const offset = add(times(pose.right, -across * width), times(pose.down, -below * width));
  pose = { ...pose, centre: add(pose.centre, offset) };
  focus = add(focus, offset);
  changed();
}

function back() {
  pose = scene.start;
  focus = scene.focus;
  changed();
}

function listenToPicture(canvas) {
  const hands = new Map();   // pointers that are down
  const middle = () => {
    const all = [...hands.values()];
    const centre = [0, 1].map((i) => all.reduce((sum, own) => sum + own[i], 0) / all.length);
    const spread = all.length > 1 ? Math.hypot(all[0][0] - all[1][0], all[0][1] - all[1][1]) : 0;
    return { centre, spread };
  };
  canvas.addEventListener('pointerdown', (event) => {
    if (scene === null) return;
    canvas.focus({ preventScroll: true });
    canvas.setPointerCapture(event.pointerId);
    hands.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.classList.add('held');
    event.preventDefault();
  });
  canvas.addEventListener('pointermove', (event) => {
    if (!hands.has(event.pointerId)) return;
    const before = middle();
    hands.set(event.pointerId, [event.clientX, event.clientY]);
    const after = middle();
    const [across, below] = [0, 1].map((i) => (after.centre[i] - before.centre[i]) / canvas.clientWidth);
    if (hands.size > 1) {
      if (before.spread > 0 && after.spread > 0) move(before.spread / after.spread);
      pan(across, below);
    } else if (event.shiftKey || event.buttons === 4) {
      pan(across, below);
    } else {
      orbit(-across * TURN, below * TURN);
    }
  });
  for (const name of ['pointerup', 'pointercancel']) {
    canvas.addEventListener(name, (event) => {
      hands.delete(event.pointerId);
      if (hands.size === 0) canvas.classList.remove('held');
    });
  }
  canvas.addEventListener('wheel', (event) => {
    if (scene === null) return;
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 16 * event.deltaY : event.deltaY;
    move(Math.exp(clamp(lines, -200, 200) / 600));
  }, { passive: false });
}

function listenToMap(canvas) {
  let at = null;
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    at = [event.clientX, event.clientY];
  });
  canvas.addEventListener('pointermove', (event) => {
    if (at === null || scene === null) return;
    const [across, below] = [event.clientX - at[0], event.clientY - at[1]].map((x) => x / canvas.clientWidth * Math.PI);
    at = [event.clientX, event.clientY];
    const around = turnedPose(observer.pose, observer.target, scene.up, -across);
    const above = turnedPose(around, observer.target, around.right, -below);
    observer.pose = Math.abs(dot(above.forward, scene.up)) < 0.98 ? above : around;
    drawMapSoon();
  });
  for (const name of ['pointerup', 'pointercancel']) canvas.addEventListener(name, () => { at = null; });
}

function listenToKeys() {
  const actions = {
    ArrowLeft: () => orbit(-STEP, 0),
    ArrowRight: () => orbit(STEP, 0),
    ArrowUp: () => orbit(0, STEP),
    ArrowDown: () => orbit(0, -STEP),
    '+': () => move(0.95),
    '=': () => move(0.95),
    '-': () => move(1 / 0.95),
    0: back,
  };
  document.addEventListener('keydown', (event) => {
    const isTyping = event.target instanceof Element && event.target.matches('input, select, textarea');
    const action = actions[event.key];
    if (scene === null || isTyping || !action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
  });
}

function listenToSettings() {
  element('scheme').addEventListener('change', () => { chooseScheme(); schemeChanged(); });
  element('choice').addEventListener('change', schemeChanged);
  element('parameter').addEventListener('input', schemeChanged);
  element('overlay').addEventListener('change', drawPicture);
  element('strength').addEventListener('input', drawPicture);
  element('layers').addEventListener('change', (event) => { layer = event.target.value; changed(); });
  element('save').addEventListener('click', save);
  element('copy').addEventListener('click', copy);
  const redraw = () => { drawPicture(); drawMap(); };
  new ResizeObserver(redraw).observe(element('picture'));
  new ResizeObserver(redraw).observe(element('map'));
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);
}

// ---------------------------------------------------------------- start

// Distance from a camera to the nearest other one, in the middle of all: frusta of this size do not cover each other.
function frustumDepth(sources, distance) {
  const gaps = sources.map((own) => Math.min(...sources.filter((other) => other !== own)
    .map((other) => length(sub(own.pose.centre, other.pose.centre))))).sort((a, b) => a - b);
  const gap = gaps[Math.floor(gaps.length / 2)];
  return clamp(Number.isFinite(gap) ? gap : distance, 0.04 * distance, 0.2 * distance);
}

async function begin() {
  listenToPicture(element('picture'));
  listenToMap(element('map'));
  listenToKeys();
  drawScale(element('scale'));
  drawScale(element('layer-scale'));
  watch();
  try {
    const found = await (await fetch('scene')).json();
    for (const camera of [...found.sources, ...found.others]) camera.pose = poseOf(camera.pose);
    found.start = poseOf(found.start);
    found.frustum = frustumDepth(found.sources, found.distance);
    scene = found;
  } catch (error) {
    told(error);
    return;
  }
  document.title = `${scene.name} · viewfuse`;
  element('name').textContent = scene.name;
  element('about').textContent = `${scene.sources.length} source views, ${scene.field} field on ${scene.device}`;
  element('picture').style.aspectRatio = scene.size.join(' / ');
  element('picture').style.maxWidth = `calc(68vh * ${scene.size[0] / scene.size[1]})`;
  pose = scene.start;
  focus = scene.focus;
  observer = firstObserver();
  showSources();
  showSchemes();
  listenToSettings();
  changed();
  const photographs = setInterval(() => {
    if (shown === null) return;
    clearInterval(photographs);
    showPhotographs();
  }, 50);
}

begin();
