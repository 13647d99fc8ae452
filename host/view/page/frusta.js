// Cameras as frusta, in the picture and in the map.

import { css } from './colours.js';
import { inCamera } from './poses.js';
import { state } from './state.js';
import { add, sub, times } from './vectors.js';

// The centre and the corners of a camera's image, at a depth.
export function frustum({ pose: own, lens }, depth) {
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
export function drawFrustum(context, eye, project, points, colour, width) {
  const seen = points.map((point) => inCamera(eye, point));
  const near = NEAR * state.scene.distance;
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
export function drawSources(context, eye, project, ratio, own, isMap) {
  const most = Math.max(...own, 1e-9);
  const order = own.map((_, i) => i).sort((a, b) => own[a] - own[b]);
  const tips = order.map((i) => {
    const share = own[i] / most;
    const source = state.scene.sources[i];
    // In the picture, cameras beside the eye would cover everything and show nothing.
    if (!isMap && inCamera(eye, source.pose.centre)[2] < 0.1 * state.scene.distance) return null;
    return drawFrustum(context, eye, project, frustum(source, state.scene.frustum), css(share), (1 + 2 * share) * ratio)[0];
  });
  if (!isMap) return;
  // Names, of the greatest weights first, where they do not cover one another.
  const style = getComputedStyle(document.body);
  const taken = [];
  for (const place of order.keys()) {
    const at = order.length - 1 - place;
    const { name } = state.scene.sources[order[at]];
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
