// The weights of the source cameras for a view: the scheme distance:power=2, inverse square distance of the centres.

import { length, sub } from './vectors.js';

export function weightsOf(cameras, pose) {
  const squares = cameras.map((camera) => length(sub(camera.pose.centre, pose.centre)) ** 2);
  const least = Math.min(...squares);
  // At a camera all weight is its own: as quotients of the least square nothing overflows.
  const shares = squares.map((own) => (own === least ? 1 : least / own));
  const sum = shares.reduce((a, b) => a + b, 0);
  return shares.map((own) => own / sum);
}
