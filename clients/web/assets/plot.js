// What pictures of ratings are drawn with.

const SVG = "http://www.w3.org/2000/svg";

/** About `n` round numbers between two. */
export function roundNumbers(low, high, n) {
  const least = (high - low) / n || 1;
  const power = 10 ** Math.floor(Math.log10(least));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= least);
  return Array.from({ length: Math.floor((high - low) / step) + 1 }, (_, index) => (Math.ceil(low / step) + index) * step + 0).filter((one) => one <= high);
}

/** An element of a picture. */
export function draw(tag, properties, text = "") {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(properties)) element.setAttribute(name, value);
  element.textContent = text;
  return element;
}
