// A journal or a transcript from the reader's own disk: dropped onto the page, or chosen. The server reads it and keeps nothing.
import { ask, h, route } from "./dom.js";
import { Downloads } from "./downloads.js";
import { MatchView } from "./replay.js";

const ASKED = "Drop a journal or a transcript onto this page, or choose one. It is read and not kept.";

export function show(main) {
  document.title = "Open a file - Arena";
  const choose = h("input", { type: "file", id: "file", onchange: () => choose.files[0] && open(choose.files[0]) });
  const zone = h("div", { class: "drop controls" }, h("label", { for: "file" }, "Journal or transcript"), choose);
  const view = new MatchView(main);
  view.title.textContent = "Open a file";
  view.state.before(zone);
  view.announce(ASKED);

  async function open(file) {
    view.clear();
    history.replaceState(null, "", location.pathname); // the tick there was of another file
    view.announce(`Reading ${file.name}...`);
    const fetch = (form, query) => ask(route("open", { form, ...query }), { method: "POST", body: file });
    const data = await fetch("frames", {});
    if (data.error) {
      view.title.textContent = "Open a file";
      view.announce(`${file.name} cannot be shown: ${data.error}.`, true);
      return;
    }
    view.showReplay(data);
    if (view.player) view.stage.append(new Downloads(view.player, fetch, ["html"]).element);
  }

  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    zone.classList.add("over");
  });
  for (const kind of ["dragleave", "drop"]) document.addEventListener(kind, () => zone.classList.remove("over"));
  document.addEventListener("drop", (event) => {
    event.preventDefault(); // which would open the file in place of this page
    if (event.dataTransfer.files[0]) open(event.dataTransfer.files[0]);
  });
}
