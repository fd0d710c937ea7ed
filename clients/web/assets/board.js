// A board on a canvas: the codes of Table 2 as colours, shapes and letters. Capitals are blue's, small letters red's.

export const CODE = { blueHalf: "0", redHalf: "1", blueUgv: "2", blueUav: "3", redUgv: "4", redUav: "5", blueFlag: "6", redFlag: "7", obstacle: "8" };
export const TEAMS = ["blue", "red"];
const UNITS = { [CODE.blueUgv]: ["blue", false], [CODE.blueUav]: ["blue", true], [CODE.redUgv]: ["red", false], [CODE.redUav]: ["red", true] };
const COLOURS = ["hidden", "hidden-line", "half-blue", "half-red", "obstacle", "unit-blue", "unit-red", "unit-ink-blue", "unit-ink-red", "mark", "ink", "fog", "line"];

/** The team whose half lies at the left, as far as a board shows it. */
function leftTeam(side, ...grids) {
  for (const grid of grids) {
    for (let cell = 0; cell < grid.length; cell++) {
      const team = grid[cell] === CODE.blueHalf ? 0 : grid[cell] === CODE.redHalf ? 1 : null;
      if (team !== null) return cell % side < side / 2 ? team : 1 - team;
    }
  }
  return 0;
}

export class Board {
  /** `rules` as the server describes them; `label` names the board to who cannot see it. */
  constructor(rules, label) {
    this.side = rules.side;
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.label(label);
    this.scene = null;
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.canvas);
    this.readColours();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { this.readColours(); this.draw(); });
  }

  label(text) {
    if (this.canvas.getAttribute("aria-label") !== text) this.canvas.setAttribute("aria-label", text);
  }

  readColours() {
    const style = getComputedStyle(document.documentElement);
    this.colour = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }

  resize() {
    const size = Math.round(this.canvas.clientWidth * devicePixelRatio);
    if (size && (size !== this.canvas.width || size !== this.canvas.height)) {
      this.canvas.width = this.canvas.height = size;
      this.draw();
    }
  }

  /** The cell at a point of the window, as [row, column]; null beside the board. */
  cellAt(x, y) {
    const box = this.canvas.getBoundingClientRect();
    const [row, column] = [y - box.top, x - box.left].map((at) => Math.floor((at / box.width) * this.side));
    return row >= 0 && column >= 0 && row < this.side && column < this.side ? [row, column] : null;
  }

  /**
   * Show a scene: `grid`, and if there are any `known` (what is remembered where `grid` is hidden), `discs` ({cell, sight,
   * attack}), `marks` ({cell, kind: "fall" | "fight" | "capture"}), `routes` (lists of cells), `targets` (cells),
   * `numbers` ({cell, text}) and `selected` (a cell).
   */
  show(scene) {
    this.scene = scene;
    this.draw();
  }

  draw() {
    const { scene, canvas, side } = this;
    if (!scene || canvas.width < side) return;
    const pen = canvas.getContext("2d");
    const size = canvas.width / side;
    pen.setTransform(1, 0, 0, 1, 0, 0);
    this.pen = pen;
    this.size = size;
    this.left = leftTeam(side, scene.grid, scene.known ?? "");
    for (let cell = 0; cell < scene.grid.length; cell++) this.drawGround(cell, scene);
    for (const disc of scene.discs ?? []) this.drawDisc(disc);
    for (const route of scene.routes ?? []) this.drawRoute(route);
    for (let cell = 0; cell < scene.grid.length; cell++) this.drawThing(cell, scene.grid[cell]);
    for (const mark of scene.marks ?? []) this.drawMark(mark);
    if (scene.selected) this.frame(scene.selected, this.colour.ink, 0.12);
    for (const number of scene.numbers ?? []) this.drawNumber(number);
  }

  drawGround(cell, { grid, known }) {
    const { pen, size, side, colour } = this;
    const [row, column] = [Math.floor(cell / side), cell % side];
    const [x, y] = [Math.round(column * size), Math.round(row * size)];
    const [width, height] = [Math.round((column + 1) * size) - x, Math.round((row + 1) * size) - y];
    const code = grid[cell] === "?" ? (known?.[cell] ?? "?") : grid[cell];
    const half = (column < side / 2) === (this.left === 0) ? "half-blue" : "half-red";
    pen.fillStyle = code === "?" ? colour.hidden : code === CODE.obstacle ? colour.obstacle : colour[half];
    pen.fillRect(x, y, width, height);
    if (grid[cell] === "?") {
      if (code !== "?") {
        pen.fillStyle = colour.fog;
        pen.fillRect(x, y, width, height);
      }
      pen.strokeStyle = colour["hidden-line"]; // hatched: fog is data from land without colours
      pen.lineWidth = Math.max(1, size * 0.05);
      pen.beginPath();
      pen.moveTo(x, y + height);
      pen.lineTo(x + width, y);
      pen.stroke();
      if (code === CODE.blueFlag || code === CODE.redFlag) this.drawThing(cell, code); // a remembered one
    }
  }

  drawThing(cell, code) {
    const [row, column] = [Math.floor(cell / this.side), cell % this.side];
    if (code === CODE.blueFlag || code === CODE.redFlag) this.drawFlag(row, column, code === CODE.blueFlag ? "blue" : "red");
    else if (UNITS[code]) this.drawUnit(row, column, ...UNITS[code]);
  }

  drawUnit(row, column, team, flies) {
    const { pen, size, colour } = this;
    const [x, y] = [(column + 0.5) * size, (row + 0.5) * size];
    pen.fillStyle = colour[`unit-${team}`];
    pen.strokeStyle = colour.ink;
    pen.lineWidth = Math.max(1, size * 0.06);
    pen.beginPath();
    if (flies) pen.arc(x, y, size * 0.42, 0, 2 * Math.PI);
    else pen.rect(x - size * 0.41, y - size * 0.41, size * 0.82, size * 0.82);
    pen.fill();
    pen.stroke();
    const letter = flies ? "A" : "U";
    this.write(team === "blue" ? letter : letter.toLowerCase(), x, y, colour[`unit-ink-${team}`], 0.62);
  }

  drawFlag(row, column, team) {
    const { pen, size, colour } = this;
    const [x, y] = [column * size, row * size];
    const [pole, tip] = team === "blue" ? [0.22, 0.88] : [0.78, 0.12]; // the pennants point at each other
    pen.lineWidth = Math.max(1, size * 0.1);
    pen.strokeStyle = colour.ink;
    pen.beginPath();
    pen.moveTo(x + pole * size, y + 0.94 * size);
    pen.lineTo(x + pole * size, y + 0.08 * size);
    pen.stroke();
    pen.fillStyle = colour[`unit-${team}`];
    pen.beginPath();
    pen.moveTo(x + pole * size, y + 0.08 * size);
    pen.lineTo(x + tip * size, y + 0.33 * size);
    pen.lineTo(x + pole * size, y + 0.6 * size);
    pen.fill();
  }

  drawDisc({ cell: [row, column], sight, attack }) {
    const { pen, size, side, colour } = this;
    pen.fillStyle = colour.mark;
    pen.globalAlpha = 0.16;
    for (let r = Math.max(0, row - sight); r <= Math.min(side - 1, row + sight); r++) {
      for (let c = Math.max(0, column - sight); c <= Math.min(side - 1, column + sight); c++) {
        if ((r - row) ** 2 + (c - column) ** 2 <= sight ** 2) pen.fillRect(c * size, r * size, size, size);
      }
    }
    pen.globalAlpha = 1;
    if (attack > 0) {
      pen.strokeStyle = colour.mark;
      pen.lineWidth = Math.max(1.5, size * 0.09);
      pen.setLineDash([size * 0.25, size * 0.18]);
      pen.beginPath();
      pen.arc((column + 0.5) * size, (row + 0.5) * size, attack * size, 0, 2 * Math.PI);
      pen.stroke();
      pen.setLineDash([]);
    }
  }

  drawMark({ cell, kind }) {
    if (kind === "fight") {
      this.frame(cell, this.colour.mark, 0.1);
      return;
    }
    const { pen, size } = this;
    const [x, y] = [(cell[1] + 0.5) * size, (cell[0] + 0.5) * size];
    for (const [colour, width] of [[this.colour["half-blue"], 0.3], [this.colour.mark, 0.16]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = size * width;
      pen.beginPath();
      if (kind === "capture") pen.arc(x, y, size * 0.62, 0, 2 * Math.PI);
      else for (const slope of [1, -1]) { pen.moveTo(x - size * 0.34, y - slope * size * 0.34); pen.lineTo(x + size * 0.34, y + slope * size * 0.34); }
      pen.stroke();
    }
  }

  drawRoute(cells) {
    const { pen, size, colour } = this;
    pen.strokeStyle = colour.mark;
    pen.lineWidth = Math.max(1.5, size * 0.1);
    pen.setLineDash([size * 0.2, size * 0.2]);
    pen.beginPath();
    cells.forEach(([row, column], index) => pen[index ? "lineTo" : "moveTo"]((column + 0.5) * size, (row + 0.5) * size));
    pen.stroke();
    pen.setLineDash([]);
    if (cells.length > 1) this.frame(cells.at(-1), colour.mark, 0.08);
  }

  drawNumber({ cell: [row, column], text }) {
    const { size, colour, pen } = this;
    const [x, y] = [(column + 0.84) * size, (row + 0.18) * size];
    pen.fillStyle = colour.ink;
    pen.beginPath();
    pen.arc(x, y, size * 0.27, 0, 2 * Math.PI);
    pen.fill();
    this.write(text, x, y, colour["half-blue"], 0.42);
  }

  frame([row, column], colour, width) {
    const { pen, size } = this;
    pen.strokeStyle = colour;
    pen.lineWidth = Math.max(2, size * width);
    pen.strokeRect((column + 0.03) * size, (row + 0.03) * size, size * 0.94, size * 0.94);
  }

  write(text, x, y, colour, height) {
    const { pen, size } = this;
    pen.fillStyle = colour;
    pen.font = `700 ${size * height}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText(text, x, y + size * 0.03);
  }
}
