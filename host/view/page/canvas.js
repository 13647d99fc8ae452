// Canvases as large as they are on the screen.

// A canvas as large as it is on the screen, in the screen's own pixels.
export function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * ratio)));
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const context = canvas.getContext('2d', { willReadFrequently: false });
  context.setTransform(1, 0, 0, 1, 0, 0);
  return { context, width, height, ratio };
}
