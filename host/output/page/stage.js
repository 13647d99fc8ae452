// The picture: the viewer's canvas, and the outlines of the source cameras over it.

import { splatData } from './gaussians.js';
import { drawCameras } from './outlines.js';
import { sub, times } from './vectors.js';

const STILL = 300;           // milliseconds after the last order of the Gaussians in which another one may come
const MAX_WAIT = 10000;      // milliseconds for the first one

// `viewer` are the viewer's classes, `told` what the page says of the scene.
export function stageOf(viewer, told, canvas, overlay) {
  const { Camera, Matrix3, Quaternion, Scene, Splat, Vector3, WebGLRenderer } = viewer;
  const renderer = new WebGLRenderer(canvas, []);
  canvas.style.background = 'transparent';
  const [camera, scene] = [new Camera(), new Scene()];
  scene.addObject(new Splat(splatData(viewer.SplatData, told.gaussians, told.focus, told.unit)));
  camera.data.near = 0.02 * told.distance / told.unit;
  camera.data.far = 1000 * told.distance / told.unit;
  let [view, lens, weights, hasOutlines] = [null, null, [], true];
  // When the last change was, the order that was drawn last, whether the view's own is still to come, whether a frame is.
  let [changed, order, isAwaited, isAsked] = [0, null, false, false];

  function fit() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const size = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * ratio)));
    // The whole picture of the lens, in the middle of the canvas.
    const zoom = Math.min(size[0] / lens.size[0], size[1] / lens.size[1]);
    [camera.data.fx, camera.data.fy] = lens.focal.map((focal) => zoom * focal);
    renderer.setSize(...size);
    [overlay.width, overlay.height] = size;
    // The viewer reads its focal lengths only when it begins.
    const { gl, renderProgram: { program } } = renderer;
    gl.useProgram(program);
    gl.uniform2f(gl.getUniformLocation(program, 'focal'), camera.data.fx, camera.data.fy);
  }

  function drawOutlines() {
    const context = overlay.getContext('2d');
    context.clearRect(0, 0, overlay.width, overlay.height);
    if (!hasOutlines) return;
    const project = ([x, y, z]) => [
      camera.data.fx * x / z + overlay.width / 2, camera.data.fy * y / z + overlay.height / 2,
    ];
    const { cameras, distance } = told;
    drawCameras(context, view.pose, project, { cameras, weights, depth: 0.12 * distance, distance, ratio: 1 });
  }

  function draw(time) {
    isAsked = false;
    const { pose } = view;
    camera.position = new Vector3(...times(sub(pose.centre, told.focus), 1 / told.unit));
    const rows = [0, 1, 2].flatMap((i) => [pose.right[i], pose.down[i], pose.forward[i]]);
    camera.rotation = Quaternion.FromMatrix3(new Matrix3(...rows));
    renderer.render(scene, camera);
    drawOutlines();
    const { depthIndex } = renderer.renderProgram;
    if (depthIndex !== order && depthIndex.length > 0) [order, changed, isAwaited] = [depthIndex, time, false];
    // A picture at rest takes no power.
    if (time - changed < (isAwaited ? MAX_WAIT : STILL)) ask(); else document.body.dataset.state = 'still';
  }

  function ask() {
    if (!isAsked) requestAnimationFrame(draw);
    isAsked = true;
  }

  const change = () => {
    changed = performance.now();
    document.body.dataset.state = 'moving';
    ask();
  };
  new ResizeObserver(() => {
    if (view === null) return;
    fit();
    change();
  }).observe(canvas);
  return {
    show(own, through, shares) {
      const isFirst = view === null;
      isAwaited ||= isFirst || own.pose !== view.pose;
      const isOther = through !== lens;
      [view, lens, weights] = [own, through, shares];
      // The viewer's program begins with the first picture.
      if (isFirst) renderer.render(scene, camera);
      if (isOther) fit();
      change();
    },
    outlines(are) {
      hasOutlines = are;
      change();
    },
  };
}
