// A journal or a transcript from the reader's own disk, or both of one match: dropped onto the page, or chosen. The server reads
// them and keeps nothing.
import { ask, h, route } from "./dom.js";
import { Downloads } from "./downloads.js";
import { MatchView } from "./replay.js";

const ASKED = "Drop a journal or a transcript onto this page, or choose one; or both of a match, to see what your bot noted beside the truth. They are read and not kept.";

/** Put what the bot of a transcript noted into the journal of its match; null if they are not of one match. */
function join(journal, transcript) {
  if (journal.match !== transcript.match) return null;
  transcript.ticks.forEach(({ annotations }, at) => { if (journal.ticks[at]) journal.ticks[at].annotations = annotations; });
  return Object.assign(journal, { noted: transcript.team });
}

export function show(main) {
  document.title = "Open a file - Arena";
  const choose = h("input", { type: "file", id: "file", multiple: true, onchange: () => choose.files.length && open([...choose.files]) });
  const zone = h("div", { class: "drop controls" }, h("label", { for: "file" }, "Journal or transcript"), choose);
  const view = new MatchView(main);
  view.title.textContent = "Open a file";
  view.state.before(zone);
  view.announce(ASKED);

  async function open(files) {
    const names = files.map((file) => file.name).join(" and ");
    view.clear();
    history.replaceState(null, "", location.pathname); // the tick there was of another file
    view.announce(`Reading ${names}...`);
    const send = (file, form, query) => ask(route("open", { form, ...query }), { method: "POST", body: file });
    const answers = await Promise.all(files.slice(0, 2).map((file) => send(file, "frames", {})));
    const [journals, transcripts] = [answers.filter((one) => one.team === undefined), answers.filter((one) => one.team !== undefined)];
    const failed = answers.find((one) => one.error);
    const data = answers.length === 1 ? answers[0] : journals.length === 1 && join(journals[0], transcripts[0]);
    if (failed || !data) {
      view.title.textContent = "Open a file";
      const why = failed ? failed.error : "these are not the journal and a transcript of one match";
      view.announce(`${failed ? files[answers.indexOf(failed)].name : names} cannot be shown: ${why}.`, true);
      return;
    }
    view.showReplay(data);
    if (view.player && answers.length === 1) view.stage.append(new Downloads(view.player, (form, query) => send(files[0], form, query), ["html"]).element);
  }

  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    zone.classList.add("over");
  });
  for (const kind of ["dragleave", "drop"]) document.addEventListener(kind, () => zone.classList.remove("over"));
  document.addEventListener("drop", (event) => {
    event.preventDefault(); // which would open the file in place of this page
    if (event.dataTransfer.files.length) open([...event.dataTransfer.files]);
  });
}
