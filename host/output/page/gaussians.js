// The Gaussians of the page, as the viewer takes them. They are stored as base64 of little-endian numbers, one array after
// the other: means (3 floats), logarithms of the scales (3 whole numbers of 16 bits between two limits), rotations
// (w, x, y, z: 4 of 16 bits with a sign), colours and opacities (4 bytes).

const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

// `stored` is { count, limits, means, scales, rotations, colours }; the viewer's own `SplatData` is made of it. `centre` and
// `unit` are the middle and the unit of the viewer's coordinates: it keeps variances in half precision.
export function splatData(SplatData, { count, limits, means, scales, rotations, colours }, centre, unit) {
  const positions = new Float32Array(bytesOf(means));
  for (let i = 0; i < positions.length; i += 1) positions[i] = (positions[i] - centre[i % 3]) / unit;
  const step = (limits[1] - limits[0]) / 65535;
  const deviations = Float32Array.from(new Uint16Array(bytesOf(scales)), (own) => Math.exp(limits[0] + own * step) / unit);
  const turns = Float32Array.from(new Int16Array(bytesOf(rotations)), (own) => own / 32767);
  return new SplatData(count, positions, turns, deviations, new Uint8Array(bytesOf(colours)));
}
