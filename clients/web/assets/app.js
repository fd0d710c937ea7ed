// Which page stands at which address.
import { spectatorKey } from "./dom.js";

const PAGES = [
  [/^\/$/, "./lobby.js"],
  [/^\/match\/([^/]+)$/, "./match.js"],
  [/^\/league$/, "./league.js"],
  [/^\/play$/, "./play.js"],
];

const given = new URLSearchParams(location.hash.slice(1)).get("key");
if (given) {
  spectatorKey.set(given);
  history.replaceState(null, "", location.pathname + location.search); // so that nobody copies it with the address
}
for (const link of document.querySelectorAll("nav a")) {
  if (link.getAttribute("href") === location.pathname) link.setAttribute("aria-current", "page");
}
for (const [pattern, module] of PAGES) {
  const found = pattern.exec(location.pathname);
  if (found) {
    const page = await import(module);
    page.show(document.getElementById("main"), ...found.slice(1).map(decodeURIComponent));
  }
}
