// A scene of Gaussians as one file: the picture, the source cameras and their weights for the view on the screen.

import { listenToHands, listenToKeys } from './hands.js';
import { orbitActions } from './orbits.js';
import { poseOf } from './poses.js';
import { seenFrom, tellSeen } from './seen.js';
import { cameraButton, tellShares } from './shares.js';
import { stageOf } from './stage.js';
import { weightsOf } from './weights.js';

const element = (id) => document.getElementById(id);
const told = JSON.parse(element('scene').textContent);
told.cameras = told.cameras.map((camera) => ({ ...camera, pose: poseOf(camera.pose) }));

function listOf(cameras, go) {
  return cameras.map((camera) => {
    const [item, name] = ['li', 'span'].map((own) => document.createElement(own));
    const parts = cameraButton(camera.name, () => go(camera));
    name.textContent = camera.name;
    parts.button.append(name, parts.bar, parts.value);
    item.append(parts.button);
    element('sources').append(item);
    return parts;
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
  const buttons = listOf(told.cameras, (camera) => show({ pose: camera.pose, focus: told.focus }, camera.lens));
  function show(own, through = lens) {
    [view, lens] = [own, through];
    const weights = weightsOf(told.cameras, view.pose);
    tellShares(buttons, weights);
    const isOutside = tellSeen(element('support'), seenFrom(told, view.pose.centre));
    element('frame').classList.toggle('outside', isOutside);
    stage.show(view, lens, weights);
  }
  const back = () => show({ pose: start.pose, focus: told.focus }, start.lens);
  const read = () => [view, { up: told.up, distance: told.distance, lens }];
  const actions = { isReady: () => true, start() {}, ...orbitActions(read, show) };
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
