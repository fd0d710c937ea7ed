// The start of a match that was saved as one file: it stands packed in the page itself.
import { MatchView } from "./replay.js";

const main = document.getElementById("main");
const packed = Uint8Array.from(atob(main.dataset.match), (letter) => letter.charCodeAt(0));
const data = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).json();
new MatchView(main).showReplay(data);
