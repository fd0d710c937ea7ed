// A board on a canvas: the codes of Table 2 as colours, shapes and letters. Capitals are blue's, small letters red's.

export const CODE = { blueHalf: "0", redHalf: "1", blueUgv: "2", blueUav: "3", redUgv: "4", redUav: "5", blueFlag: "6", redFlag: "7", obstacle: "8" };
export const TEAMS = ["blue", "red"];
const UNITS = { [CODE.blueUgv]: ["blue", false], [CODE.blueUav]: ["blue", true], [CODE.redUgv]: ["red", false], [CODE.redUav]: ["red", true] };
const COLOURS = ["hidden", "hidden-line", "half-blue", "half-red", "obstacle", "unit-blue", "unit-red", "unit-ink-blue", "unit-ink-red", "mark", "ink", "fog", "line"];
const STEPS = { 1: [-1, 0], 2: [0, 1], 3: [1, 0], 4: [0, -1] };
/** What a bot draws with; the same by day and by night. */
const PAINTS = { red: "#e02b3c", orange: "#f08a00", yellow: "#e8c500", green: "#1f9d4d", blue: "#2f7de1", purple: "#a244d8", black: "#101114", white: "#ffffff" };

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
   * Show a scene: `grid`, and if there are any `known` (what is remembered where `grid` is hidden), `heats` ({levels: 0 to 1 by
   * cell, colour}), `sights` ({cells: 0 or 1 by cell, team}), `discs` ({cell, sight, reach}), `trails` ({cells, team}), `routes`
   * (lists of cells), `names` (a Map from cell and code to what stands on the unit), `marks` ({cell, kind: "fall" | "fight" |
   * "capture"}), `drawings` (a bot's own), `arrows` ({cell, action, team}), `numbers` ({cell, text}) and `selected` (a cell).
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
    this.drawGround(scene);
    for (const heat of scene.heats ?? []) this.drawHeat(heat);
    for (const area of scene.sights ?? []) this.drawSight(area);
    for (const disc of scene.discs ?? []) this.drawDisc(disc);
    for (const drawing of scene.drawings ?? []) this.drawDrawing(drawing);
    for (const trail of scene.trails ?? []) this.drawTrail(trail);
    for (const route of scene.routes ?? []) this.drawRoute(route);
    for (const step of scene.steps ?? []) this.drawStep(step);
    for (let cell = 0; cell < scene.grid.length; cell++) this.drawThing(cell, scene.grid[cell]);
    for (const mark of scene.marks ?? []) this.drawMark(mark);
    for (const { cell, text } of scene.drawings ?? []) if (text) this.writeOver(text, (cell[1] + 0.5) * size, (cell[0] + 0.5) * size);
    for (const arrow of scene.arrows ?? []) this.drawArrow(arrow);
    if (scene.selected) this.frame(scene.selected, this.colour.ink, 0.12);
    for (const number of scene.numbers ?? []) this.drawNumber(number);
  }

  /** Where a cell lies, in whole pixels: x, y, width, height. */
  box(cell) {
    const { size, side } = this;
    const [row, column] = [Math.floor(cell / side), cell % side];
    const [x, y] = [Math.round(column * size), Math.round(row * size)];
    return [x, y, Math.round((column + 1) * size) - x, Math.round((row + 1) * size) - y];
  }

  drawGround({ grid, known }) {
    const { pen, size, side, colour } = this;
    const remembered = [];
    const hatches = new Path2D(); // all at once, since each stroke has its price
    for (let cell = 0; cell < grid.length; cell++) {
      const box = this.box(cell);
      const code = grid[cell] === "?" ? (known?.[cell] ?? "?") : grid[cell];
      const half = (cell % side < side / 2) === (this.left === 0) ? "half-blue" : "half-red";
      pen.fillStyle = code === "?" ? colour.hidden : code === CODE.obstacle ? colour.obstacle : colour[half];
      pen.fillRect(...box);
      if (grid[cell] !== "?") continue;
      if (code !== "?") {
        pen.fillStyle = colour.fog;
        pen.fillRect(...box);
      }
      hatches.moveTo(box[0], box[1] + box[3]);
      hatches.lineTo(box[0] + box[2], box[1]);
      if (code === CODE.blueFlag || code === CODE.redFlag) remembered.push([cell, code]);
    }
    pen.strokeStyle = colour["hidden-line"]; // hatched: fog is data from land without colours
    pen.lineWidth = Math.max(1, size * 0.05);
    pen.stroke(hatches);
    for (const [cell, code] of remembered) this.drawThing(cell, code);
  }

  drawThing(cell, code) {
    const [row, column] = [Math.floor(cell / this.side), cell % this.side];
    if (code === CODE.blueFlag || code === CODE.redFlag) this.drawFlag(row, column, code === CODE.blueFlag ? "blue" : "red");
    else if (UNITS[code]) this.drawUnit(row, column, ...UNITS[code], this.scene.names?.get(`${cell} ${code}`) ?? "");
  }

  drawUnit(row, column, team, flies, number) {
    const { pen, size, colour } = this;
    const [x, y] = [(column + 0.5) * size, (row + 0.5) * size];
    pen.fillStyle = colour[`unit-${team}`];
    pen.strokeStyle = colour.ink;
    pen.lineWidth = Math.max(1, size * 0.06);
    pen.beginPath();
    if (flies) pen.arc(x, y, size * 0.44, 0, 2 * Math.PI);
    else pen.rect(x - size * 0.42, y - size * 0.42, size * 0.84, size * 0.84);
    pen.fill();
    pen.stroke();
    const letter = flies ? "A" : "U";
    this.write(`${team === "blue" ? letter : letter.toLowerCase()}${number}`, x, y, colour[`unit-ink-${team}`], [0.62, 0.56, 0.42][number.length] ?? 0.34);
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

  /** The cells that a unit sees, and around those in which it hits, a dashed line: `reach` is a squared distance. */
  drawDisc({ cell: [row, column], sight, reach }) {
    const { side, colour, pen, size } = this;
    const within = (most) => Array.from({ length: side * side }, (_, cell) => (Math.floor(cell / side) - row) ** 2 + ((cell % side) - column) ** 2 <= most);
    this.fillCells(within(sight ** 2), colour.mark, 0.16);
    if (reach < 0) return;
    pen.strokeStyle = colour.mark;
    pen.lineWidth = Math.max(1.5, size * 0.09);
    pen.setLineDash([size * 0.25, size * 0.18]);
    this.outline(within(reach));
    pen.setLineDash([]);
  }

  /** A ring in a cell to which a unit can go. */
  drawStep([row, column]) {
    const { pen, size, colour } = this;
    pen.strokeStyle = colour.mark;
    pen.lineWidth = Math.max(1.5, size * 0.09);
    pen.beginPath();
    pen.arc((column + 0.5) * size, (row + 0.5) * size, size * 0.2, 0, 2 * Math.PI);
    pen.stroke();
  }

  drawSight({ cells, team }) {
    const { pen, size, colour } = this;
    this.fillCells(cells, colour[`unit-${team}`], 0.14);
    pen.strokeStyle = colour[`unit-${team}`];
    pen.lineWidth = Math.max(1, size * 0.06);
    this.outline(cells);
  }

  drawHeat({ levels, colour }) {
    this.fillCells(levels, this.colour[colour] ?? PAINTS[colour], 0.75);
  }

  /** Fill cells as strongly as each is high, from 0 to 1. */
  fillCells(levels, colour, most) {
    const { pen } = this;
    pen.fillStyle = colour;
    for (let cell = 0; cell < levels.length; cell++) {
      if (!levels[cell]) continue;
      pen.globalAlpha = most * levels[cell];
      pen.fillRect(...this.box(cell));
    }
    pen.globalAlpha = 1;
  }

  /** Draw a line around cells. */
  outline(cells) {
    const { pen, side } = this;
    const has = (row, column) => row >= 0 && column >= 0 && row < side && column < side && cells[row * side + column];
    pen.beginPath();
    for (let cell = 0; cell < side * side; cell++) {
      if (!cells[cell]) continue;
      const [row, column, [x, y, width, height]] = [Math.floor(cell / side), cell % side, this.box(cell)];
      const edges = [[-1, 0, x, y, x + width, y], [1, 0, x, y + height, x + width, y + height], [0, -1, x, y, x, y + height], [0, 1, x + width, y, x + width, y + height]];
      for (const [down, right, ...[fromX, fromY, toX, toY]] of edges) {
        if (has(row + down, column + right)) continue;
        pen.moveTo(fromX, fromY);
        pen.lineTo(toX, toY);
      }
    }
    pen.stroke();
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

  /** Where a unit came from: fainter, the longer ago. */
  drawTrail({ cells, team }) {
    const { pen, size, colour } = this;
    pen.strokeStyle = colour[`unit-${team}`];
    pen.lineWidth = Math.max(1.5, size * 0.16);
    pen.lineCap = "round";
    for (let at = 1; at < cells.length; at++) {
      pen.globalAlpha = 0.25 + (0.65 * at) / cells.length;
      this.line([cells[at - 1], cells[at]]);
    }
    pen.globalAlpha = 1;
    pen.lineCap = "butt";
  }

  drawRoute(cells) {
    const { pen, size, colour } = this;
    pen.strokeStyle = colour.mark;
    pen.lineWidth = Math.max(1.5, size * 0.1);
    pen.setLineDash([size * 0.2, size * 0.2]);
    this.line(cells);
    pen.setLineDash([]);
    if (cells.length > 1) this.frame(cells.at(-1), colour.mark, 0.08);
  }

  line(cells) {
    const { pen, size } = this;
    pen.beginPath();
    cells.forEach(([row, column], index) => pen[index ? "lineTo" : "moveTo"]((column + 0.5) * size, (row + 0.5) * size));
    pen.stroke();
  }

  /** The way that a unit is told to go: a small arrow over that edge of its cell. */
  drawArrow({ cell: [row, column], action, team }) {
    const step = STEPS[action];
    if (!step) return;
    const { pen, size, colour } = this;
    const [down, right] = step;
    const at = (ahead, aside) => [(column + 0.5 + right * ahead + down * aside) * size, (row + 0.5 + down * ahead + right * aside) * size];
    pen.beginPath();
    pen.moveTo(...at(0.74, 0));
    pen.lineTo(...at(0.45, 0.24));
    pen.lineTo(...at(0.45, -0.24));
    pen.closePath();
    pen.fillStyle = colour.ink;
    pen.strokeStyle = colour[`half-${team}`];
    pen.lineWidth = Math.max(1, size * 0.07);
    pen.stroke();
    pen.fill();
  }

  /** What a bot drew, under the units: a cell, a path, or a heat over the whole board. */
  drawDrawing({ cell, path, levels, colour }) {
    const { pen, size } = this;
    const paint = PAINTS[colour] ?? PAINTS.yellow;
    if (levels) this.drawHeat({ levels, colour });
    if (cell) {
      pen.globalAlpha = 0.45;
      pen.fillStyle = paint;
      pen.fillRect(cell[1] * size, cell[0] * size, size, size);
      pen.globalAlpha = 1;
      this.frame(cell, paint, 0.12);
    }
    if (path) {
      for (const [stroke, width] of [[this.colour["half-blue"], 0.26], [paint, 0.15]]) {
        pen.strokeStyle = stroke;
        pen.lineWidth = Math.max(1.5, size * width);
        this.line(path);
      }
    }
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

  /** Write what can be read on any ground. */
  writeOver(text, x, y) {
    const { pen, size, colour } = this;
    pen.font = `700 ${size * 0.6}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.strokeStyle = colour["half-blue"];
    pen.lineWidth = size * 0.16;
    pen.lineJoin = "round";
    pen.strokeText(text, x, y);
    pen.lineJoin = "miter";
    pen.fillStyle = colour.ink;
    pen.fillText(text, x, y);
  }
}
