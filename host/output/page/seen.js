// How much of a view the photographs show, in words, and from any place around the subject.

import { dot, sub, unit } from './vectors.js';

// A picture of which less was photographed is said to be one; below half of it, it is dimmed.
const MOSTLY_SEEN = 0.9;
export const MIN_SEEN = 0.5;

// Says it in an element, which is hidden where there is nothing to say. Whether the view leaves what was photographed.
export function tellSeen(place, seen) {
  const percent = Math.round(100 * seen);
  place.hidden = seen >= MOSTLY_SEEN;
  place.textContent = seen < MIN_SEEN
    ? `Not photographed from here: the photographs show ${percent} % of this.`
    : `The photographs show ${percent} % of this.`;
  return seen < MIN_SEEN;
}

// The share that is seen from the place of the ring around the subject which lies in the same direction; all of it
// where there is no ring.
export function seenFrom({ ring, focus }, centre) {
  const towards = (point) => unit(sub(point, focus));
  const along = ({ place }) => dot(towards(place), towards(centre));
  return ring.reduce((best, own) => (along(own) > along(best) ? own : best), ring[0])?.seen ?? 1;
}
