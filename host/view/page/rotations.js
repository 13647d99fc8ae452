// Rotations as unit quaternions [w, x, y, z], and the way from one to another.

import { cross, dot, length, times, unit } from './vectors.js';

// Of three orthonormal axes, the columns of a rotation matrix.
export function quaternionOf([x, y, z]) {
  const trace = x[0] + y[1] + z[2];
  // The greatest component first: dividing by a small one loses digits.
  const candidates = [
    [1 + trace, y[2] - z[1], z[0] - x[2], x[1] - y[0]],
    [y[2] - z[1], 1 + x[0] - y[1] - z[2], y[0] + x[1], z[0] + x[2]],
    [z[0] - x[2], y[0] + x[1], 1 + y[1] - x[0] - z[2], z[1] + y[2]],
    [x[1] - y[0], z[0] + x[2], z[1] + y[2], 1 + z[2] - x[0] - y[1]],
  ];
  return unit(candidates.reduce((best, own) => (length(own) > length(best) ? own : best)));
}

// A vector turned by a quaternion.
export function turnedBy([w, ...axis], vector) {
  const across = times(cross(axis, vector), 2);
  const again = cross(axis, across);
  return vector.map((own, i) => own + w * across[i] + again[i]);
}

// Between two rotations, the shorter way at an even speed; `share` from 0 to 1.
export function slerp(from, to, share) {
  const four = from.reduce((sum, own, i) => sum + own * to[i], 0);
  const end = four < 0 ? times(to, -1) : to;
  const angle = Math.acos(Math.min(1, Math.abs(four)));
  if (angle < 1e-6) return unit(from.map((own, i) => own + share * (end[i] - own)));
  const [a, b] = [Math.sin((1 - share) * angle), Math.sin(share * angle)];
  return unit(from.map((own, i) => a * own + b * end[i]));
}

// Coordinates of a vector along three axes.
export const along = (axes, vector) => axes.map((axis) => dot(axis, vector));
