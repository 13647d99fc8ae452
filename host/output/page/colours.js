// Colours of weights and layers: viridis.

import { clamp } from './vectors.js';

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

export const css = (share, alpha = 1) => `rgb(${colourOf(share).join(' ')} / ${alpha})`;
export const LEVELS = Array.from({ length: 256 }, (_, level) => colourOf(level / 255));

export function drawScale(canvas) {
  const context = canvas.getContext('2d');
  for (let x = 0; x < canvas.width; x += 1) {
    context.fillStyle = css(x / (canvas.width - 1));
    context.fillRect(x, 0, 1, 1);
  }
}
