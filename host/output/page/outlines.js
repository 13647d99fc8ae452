// Outlines of cameras: frusta as lines.

import { inCamera } from './poses.js';
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
