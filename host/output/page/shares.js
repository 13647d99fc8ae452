// The weights of the source cameras: for each a button that goes there, a bar and a number.

import { css } from './colours.js';

// A button, with what shows the weight. `go` takes the view there.
export function cameraButton(name, go) {
  const [button, bar, value] = ['button', 'div', 'output'].map((own) => document.createElement(own));
  button.type = 'button';
  button.title = `Go to the camera of ${name}`;
  button.addEventListener('click', go);
  bar.className = 'bar';
  bar.append(document.createElement('span'));
  return { button, bar, value };
}

// Shows weights on what `cameraButton` made; returns the greatest.
export function tellShares(buttons, weights) {
  const most = Math.max(...weights, 1e-9);
  weights.forEach((weight, i) => {
    const { bar, value } = buttons[i];
    value.textContent = `${(100 * weight).toFixed(1)} %`;
    value.dataset.weight = weight;
    bar.firstChild.style.width = `${100 * weight / most}%`;
    bar.firstChild.style.background = css(weight / most);
  });
  return most;
}
