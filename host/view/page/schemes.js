// The menu of weighting schemes, and what can be chosen of one.

import { element, state } from './state.js';
import { clamp } from './vectors.js';

const isWhole = (row) => !row.parameter && !row.choice;

// The menu, with the scheme that is shown first.
export function showSchemes(first) {
  const menu = element('scheme');
  const [name] = first.split(':');
  const isKnown = state.scene.schemes.some((row) => row.name === name);
  const names = state.scene.schemes.map((row) => row.name).concat(isKnown ? [] : [first]);
  menu.replaceChildren(...names.map((own) => new Option(own, own)));
  menu.value = isKnown ? name : first;
  chooseScheme();
  // Its own values.
  const given = new Map((first.split(':')[1] || '').split(',').map((pair) => pair.split('=')));
  const row = rowOf(menu.value);
  if (row && row.choice && given.has(row.choice.key)) element('choice').value = given.get(row.choice.key);
  if (row && row.parameter && given.has(row.parameter.key)) {
    element('parameter').value = placeOf(row.parameter, Number(given.get(row.parameter.key)));
  }
  schemeText();
  state.scheme = first;
}

const rowOf = (name) => state.scene.schemes.find((row) => row.name === name);

// A slider has 1000 steps; without a limit it goes over four decades around the default.
function valueOf({ least, most, default: usual }, place) {
  const value = most === null ? usual * 10 ** (place / 250 - 2) : least + (most - least) * place / 1000;
  return Number(value.toPrecision(3));
}

function placeOf({ least, most, default: usual }, value) {
  const place = most === null ? 250 * (2 + Math.log10(Math.max(value, 1e-30) / usual)) : 1000 * (value - least) / (most - least);
  return Math.round(clamp(place, 0, 1000));
}

export function chooseScheme() {
  const row = rowOf(element('scheme').value);
  element('choice-row').hidden = !row || !row.choice;
  element('parameter-row').hidden = !row || !row.parameter;
  if (row && row.choice) {
    element('choice-name').textContent = row.choice.key;
    element('choice').replaceChildren(...row.choice.options.map((option) => new Option(option, option)));
  }
  if (row && row.parameter) {
    element('parameter-name').textContent = row.parameter.key;
    element('parameter').value = placeOf(row.parameter, row.parameter.default);
  }
}

// What the menu, the choice and the slider say, as on the command line.
export function schemeText() {
  const name = element('scheme').value;
  const row = rowOf(name);
  if (!row || isWhole(row)) return name;
  const pairs = [];
  if (row.parameter) {
    const value = valueOf(row.parameter, Number(element('parameter').value));
    element('parameter-value').textContent = value;
    // The slider itself counts steps.
    element('parameter').setAttribute('aria-valuetext', `${row.parameter.key} ${value}`);
    pairs.push(`${row.parameter.key}=${value}`);
  }
  if (row.choice && element('choice').value !== row.choice.options[0]) pairs.push(`${row.choice.key}=${element('choice').value}`);
  return pairs.length > 0 ? `${name}:${pairs.join(',')}` : name;
}
