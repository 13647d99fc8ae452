// Cameras as frusta, in the picture and in the map.

import { drawCameras } from './outlines.js';
import { state } from './state.js';

// The source cameras, the greatest weights last. `own` are their weights.
export function drawSources(context, eye, project, ratio, own, isMap) {
  const { sources: cameras, frustum: depth, distance } = state.scene;
  const drawn = drawCameras(context, eye, project, { cameras, weights: own, depth, distance, ratio, isOutside: isMap });
  if (!isMap) return;
  // Names, of the greatest weights first, where they do not cover one another.
  const style = getComputedStyle(document.body);
  const taken = [];
  for (const [i, tip] of drawn.reverse()) {
    const { name } = cameras[i];
    if (tip[2] <= 0) continue;
    const [x, y] = project(tip);
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
