// How much of a view the photographs show, in words, and from any place around the subject.

import { dot, sub, unit } from './vectors.js';

// A picture of which less was photographed is said to be one; below half of it, it is dimmed.
const MOSTLY_SEEN = 0.9;
export const MIN_SEEN = 0.5;

// A picture with a lower PSNR, in decibels, is broken.
const POOR = 20;

// Says it in an element, which is hidden where there is nothing to say. Whether the view leaves what was photographed.
// `frame` is the record of a full picture, if there is one.
export function tellSeen(place, seen, frame) {
  place.textContent = [share(seen), doubt(frame)].filter((words) => words !== '').join(' ');
  place.hidden = place.textContent === '';
  return seen < MIN_SEEN;
}

function share(seen) {
  if (seen >= MOSTLY_SEEN) return '';
  const percent = Math.round(100 * seen);
  return seen < MIN_SEEN
    ? `Not photographed from here: the photographs show ${percent} % of this.`
    : `The photographs show ${percent} % of this.`;
}

// What photographs that were held out say of the picture, where that is bad. The share is one of cameras alone: it says
// nothing of depths that are wrong.
function doubt(frame) {
  const { expected, beyond } = frame ?? {};
  if (expected && expected.psnr < POOR) return `It is poor: a PSNR of ${Math.round(expected.psnr)} dB is expected.`;
  if (beyond?.unseen) return `It is poor: no photograph shows ${Math.round(100 * beyond.unseen)} % of its surfaces.`;
  if (beyond?.far) return 'How good it is cannot be told: the photographs are nearer to one another than to this view.';
  return '';
}

// The share that is seen from the place of the ring around the subject which lies in the same direction; all of it
// where there is no ring.
export function seenFrom({ ring, focus }, centre) {
  const towards = (point) => unit(sub(point, focus));
  const along = ({ place }) => dot(towards(place), towards(centre));
  return ring.reduce((best, own) => (along(own) > along(best) ? own : best), ring[0])?.seen ?? 1;
}
