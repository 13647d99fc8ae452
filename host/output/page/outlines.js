// Outlines of cameras: frusta as lines.

import { css } from './colours.js';
import { inCamera } from './poses.js';
import { add, sub, times } from './vectors.js';

export const NEAR = 1e-3;           // of the cameras' distance: where lines are cut before the eye

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

// A frustum as lines, cut at the depth `near` before the eye.
export function drawFrustum(context, eye, project, points, colour, width, near) {
  const seen = points.map((point) => inCamera(eye, point));
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

// Cameras as frusta of a depth, coloured by their weights, the greatest last: the places and the tips of those that are drawn.
// `distance` is the cameras' usual one; without `isOutside` the eye is among them.
export function drawCameras(context, eye, project, { cameras, weights, depth, distance, ratio, isOutside }) {
  const most = Math.max(...weights, 1e-9);
  const order = weights.map((_, i) => i).sort((a, b) => weights[a] - weights[b]);
  // Cameras beside the eye would cover everything and show nothing.
  const isDrawn = (i) => isOutside || inCamera(eye, cameras[i].pose.centre)[2] >= 0.1 * distance;
  return order.filter(isDrawn).map((i) => {
    const share = weights[i] / most;
    const points = frustum(cameras[i], depth);
    return [i, drawFrustum(context, eye, project, points, css(share), (1 + 2 * share) * ratio, NEAR * distance)[0]];
  });
}
