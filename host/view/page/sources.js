// The source views: photographs, weights, bars.

import { css } from './colours.js';
import { drawMapSoon } from './map.js';
import { element, state } from './state.js';

// A long name without its middle: names of photographs differ at their ends.
function shortened(name) {
  const letters = [...name];
  return letters.length <= 11 ? name : `${letters.slice(0, 3).join('')}…${letters.slice(-7).join('')}`;
}

// `go` takes the view to a pose.
export function showSources(go) {
  element('sources').replaceChildren(...state.scene.sources.map((source, i) => {
    const item = document.createElement('li');
    const button = document.createElement('button');
    const image = document.createElement('img');
    const name = document.createElement('span');
    const label = document.createElement('b');
    const share = document.createElement('span');
    const value = document.createElement('output');
    const bar = document.createElement('div');
    button.type = 'button';
    button.title = `Go to the camera of ${source.name}`;
    image.alt = `Photograph ${source.name}`;
    name.className = 'name';
    label.textContent = shortened(source.name);
    share.className = 'share';
    bar.className = 'bar';
    bar.append(document.createElement('span'));
    name.append(label);
    share.append(bar, value);
    button.append(image, name, share);
    button.addEventListener('click', () => go(source.pose));
    item.append(button);
    source.parts = { image, value, bar: bar.firstChild, number: i };
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
  const most = Math.max(...own, 1e-9);
  own.forEach((weight, i) => {
    const { value, bar } = state.scene.sources[i].parts;
    value.textContent = `${(100 * weight).toFixed(1)} %`;
    value.dataset.weight = weight;
    bar.style.width = `${100 * weight / most}%`;
    bar.style.background = css(weight / most);
  });
  element('sum').textContent = own.reduce((a, b) => a + b, 0).toFixed(3);
  element('most').textContent = `${(100 * most).toFixed(0)} %`;
  drawMapSoon();
}
