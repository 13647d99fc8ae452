// The picture: what was rendered, a layer over it, and the cameras in sight.

import { fitted } from './canvas.js';
import { drawSources } from './frusta.js';
import { tellSeen } from './seen.js';
import { element, state } from './state.js';

export function drawPicture() {
  if (state.shown === null) return;
  element('waiting').hidden = true;
  const canvas = element('picture');
  const { context, width, height, ratio } = fitted(canvas);
  const [own, tall] = state.scene.size;
  const scale = Math.min(width / own, height / tall);
  const [left, top] = [(width - own * scale) / 2, (height - tall * scale) / 2];
  context.fillStyle = '#000';
  context.fillRect(0, 0, width, height);
  context.imageSmoothingQuality = 'high';
  context.drawImage(state.shown.bitmap, left, top, own * scale, tall * scale);
  if (state.shown.layer) {
    context.globalAlpha = element('strength').value / 100;
    context.drawImage(state.shown.layer.bitmap, left, top, own * scale, tall * scale);
    context.globalAlpha = 1;
  }
  if (element('overlay').checked) {
    context.save();
    context.beginPath();
    context.rect(left, top, own * scale, tall * scale);
    context.clip();
    const { focal, principal } = state.scene.lens;
    const project = ([x, y, z]) => [left + scale * (focal[0] * x / z + principal[0]), top + scale * (focal[1] * y / z + principal[1])];
    drawSources(context, state.shown.pose, project, ratio, state.shown.weights, false);
    context.restore();
  }
  if (tellSeen(element('support'), state.shown.seen, state.shown.record?.frames[0])) {
    context.fillStyle = 'rgba(0, 0, 0, 0.5)';
    context.fillRect(left, top, own * scale, tall * scale);
  }
  tellLayer();
  canvas.dataset.pictures = Number(canvas.dataset.pictures || 0) + 1;
  canvas.dataset.kind = state.shown.full ? 'full' : 'coarse';
  canvas.dataset.size = state.shown.size.join('x');
}

const recent = [];           // when the last coarse pictures were drawn

export function tellStatus({ full, size, seconds, left_out: leftOut }) {
  const time = seconds < 1 ? `${Math.round(1000 * seconds)} ms` : `${seconds.toFixed(1)} s`;
  const dropped = leftOut > 0 ? `; without ${leftOut} source${leftOut === 1 ? '' : 's'} of least weight` : '';
  element('status').textContent = `${full ? 'full' : 'coarse'}, ${size.join(' × ')}, ${time}${dropped}`;
  const now = performance.now();
  if (!full) recent.push(now);
  while (recent.length > 0 && recent[0] < now - 2000) recent.shift();
  const span = recent.length > 4 ? (recent.at(-1) - recent[0]) / 1000 : 0;
  element('rate').textContent = span > 0 && !full ? `${((recent.length - 1) / span).toFixed(0)} pictures a second` : '';
}

function tellLayer() {
  const own = state.shown && state.shown.layer;
  element('strength-row').hidden = !own;
  element('layer-legend').hidden = !own;
  if (state.shown) {
    for (const input of document.querySelectorAll('input[name="layer"]')) {
      input.disabled = input.value !== 'none' && !state.shown.layers.includes(input.value);
    }
  }
  if (!own) return;
  const [least, most] = own.range.map((value) => Number(value.toPrecision(3)));
  element('layer-least').textContent = own.kind === 'depth' ? `near ${least}` : 'unsure';
  element('layer-most').textContent = own.kind === 'depth' ? `far ${most}` : 'sure';
}
