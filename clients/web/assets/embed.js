// The boards and controls of a match that is over, for other pages to embed.
import { ask, formatEnding, h, route } from "./dom.js";
import { MatchView } from "./replay.js";

export async function show(main, match) {
  const data = await ask(route("replay", { match }));
  if (data.error) {
    main.append(h("p", { class: "state bad", role: "status" }, `This match cannot be shown: ${data.error}.`));
    return;
  }
  const view = new MatchView(main);
  view.showReplay(data);
  if (!data.broken) view.announce(`Over: ${formatEnding(data.ending)}.`);
  main.append(h("a", { href: `/match/${encodeURIComponent(match)}`, target: "_blank" }, "This match in the arena"));
}
