// A scene of Gaussians as one file: the picture, the source cameras and their weights for the view on the screen.

import { css } from './colours.js';
import { listenToHands, listenToKeys } from './hands.js';
import { movedView, pannedView, turnedView } from './orbits.js';
import { poseOf } from './poses.js';
import { stageOf } from './stage.js';
import { weightsOf } from './weights.js';

const element = (id) => document.getElementById(id);
const told = JSON.parse(element('scene').textContent);
told.cameras = told.cameras.map((camera) => ({ ...camera, pose: poseOf(camera.pose) }));

function listOf(cameras, go) {
  return cameras.map((camera) => {
    const [item, button, name, bar, value] = ['li', 'button', 'span', 'div', 'output'].map((own) => document.createElement(own));
    button.type = 'button';
    button.title = `Go to the camera of ${camera.name}`;
    name.textContent = camera.name;
    bar.className = 'bar';
    bar.append(document.createElement('span'));
    button.append(name, bar, value);
    button.addEventListener('click', () => go(camera));
    item.append(button);
    element('sources').append(item);
    return { bar: bar.firstChild, value };
  });
}

function tell(parts, weights) {
  const most = Math.max(...weights, 1e-9);
  weights.forEach((weight, i) => {
    parts[i].value.textContent = `${(100 * weight).toFixed(1)} %`;
    parts[i].value.dataset.weight = weight;
    parts[i].bar.style.width = `${100 * weight / most}%`;
    parts[i].bar.style.background = css(weight / most);
  });
}

// To a page that was opened as a file, Chromium refuses workers whose module is a blob. Where a blob fails, the viewer takes an
// address that holds the module itself, and that is allowed.
function refuseBlobsAsWorkers() {
  const { Worker } = window;
  window.Worker = class extends Worker {
    constructor(address, options) {
      if (String(address).startsWith('blob:')) throw new Error('a blob');
      super(address, options);
    }
  };
}

async function begin() {
  if (window.location.protocol === 'file:') refuseBlobsAsWorkers();
  const address = URL.createObjectURL(new Blob([element('viewer').textContent], { type: 'text/javascript' }));
  const viewer = await import(address);
  const stage = stageOf(viewer, told, element('picture'), element('outlines'));
  const start = told.cameras[told.start];
  let view = { pose: start.pose, focus: told.focus };
  let lens = start.lens;
  const parts = listOf(told.cameras, (camera) => show({ pose: camera.pose, focus: told.focus }, camera.lens));
  function show(own, through = lens) {
    [view, lens] = [own, through];
    const weights = weightsOf(told.cameras, view.pose);
    tell(parts, weights);
    stage.show(view, lens, weights);
  }
  const change = (become) => (...by) => show(become(view, { up: told.up, distance: told.distance, lens }, ...by));
  const back = () => show({ pose: start.pose, focus: told.focus }, start.lens);
  const actions = {
    isReady: () => true, start() {}, turn: change(turnedView), move: change(movedView), pan: change(pannedView),
  };
  listenToHands(element('picture'), actions);
  listenToKeys(actions, back);
  element('home').addEventListener('click', back);
  element('shows-outlines').addEventListener('change', ({ target }) => stage.outlines(target.checked));
  element('waiting').hidden = true;
  show(view);
}

begin().catch((error) => {
  element('waiting').textContent = `This browser does not show the scene: ${error.message}`;
});
