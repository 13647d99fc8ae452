// The source views: photographs, weights, bars.

import { drawMapSoon } from './map.js';
import { cameraButton, tellShares } from './shares.js';
import { element, state } from './state.js';

// A long name without its middle: names of photographs differ at their ends.
function shortened(name) {
  const letters = [...name];
  return letters.length <= 11 ? name : `${letters.slice(0, 3).join('')}…${letters.slice(-7).join('')}`;
}

// `go` takes the view to a pose.
export function showSources(go) {
  element('sources').replaceChildren(...state.scene.sources.map((source, i) => {
    const [item, image, name, label, share] = ['li', 'img', 'span', 'b', 'span'].map((own) => document.createElement(own));
    const { button, bar, value } = cameraButton(source.name, () => go(source.pose));
    image.alt = `Photograph ${source.name}`;
    name.className = 'name';
    label.textContent = shortened(source.name);
    share.className = 'share';
    name.append(label);
    share.append(bar, value);
    button.append(image, name, share);
    item.append(button);
    source.parts = { image, value, bar, number: i };
    return item;
  }));
}

// Photographs are there as soon as a picture is.
export function showPhotographs() {
  for (const { parts } of state.scene.sources) parts.image.src = `source/${parts.number}`;
}

let weighed = 0;             // the newest request whose weights are shown

export function tellWeights(own, number) {
  if (number < weighed) return;
  weighed = number;
  state.weights = own;
  const most = tellShares(state.scene.sources.map((source) => source.parts), own);
  element('sum').textContent = own.reduce((a, b) => a + b, 0).toFixed(3);
  element('most').textContent = `${(100 * most).toFixed(0)} %`;
  drawMapSoon();
}
