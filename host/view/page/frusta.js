// Cameras as frusta, in the picture and in the map.

import { css } from './colours.js';
import { drawFrustum, frustum } from './outlines.js';
import { inCamera } from './poses.js';
import { state } from './state.js';

export const NEAR = 1e-3;           // of the cameras' distance

// The source cameras, the greatest weights last. `own` are their weights.
export function drawSources(context, eye, project, ratio, own, isMap) {
  const most = Math.max(...own, 1e-9);
  const order = own.map((_, i) => i).sort((a, b) => own[a] - own[b]);
  const tips = order.map((i) => {
    const share = own[i] / most;
    const source = state.scene.sources[i];
    // In the picture, cameras beside the eye would cover everything and show nothing.
    if (!isMap && inCamera(eye, source.pose.centre)[2] < 0.1 * state.scene.distance) return null;
    const points = frustum(source, state.scene.frustum);
    return drawFrustum(context, eye, project, points, css(share), (1 + 2 * share) * ratio, NEAR * state.scene.distance)[0];
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
