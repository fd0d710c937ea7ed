// Starts the page that the server chose, with what stands in its address.
import { spectatorKey, start } from "./dom.js";

const given = new URLSearchParams(location.hash.slice(1)).get("key");
if (given) {
  spectatorKey.set(given);
  history.replaceState(null, "", location.pathname + location.search); // so that nobody copies it with the address
}
const page = await import(start.script);
page.show(document.getElementById("main"), ...start.parameters);
