// Starts the page that the server chose, with what stands in its address.
import { ownerToken, spectatorKey, start } from "./dom.js";

/** Keep what the address brings that nobody else may see; returns whether it brings any. */
function keepSecrets() {
  const given = new URLSearchParams(location.hash.slice(1));
  const those = Object.entries({ key: spectatorKey, token: ownerToken }).filter(([name]) => given.get(name));
  those.forEach(([name, kept]) => kept.set(given.get(name)));
  if (those.length) history.replaceState(null, "", location.pathname + location.search); // so that nobody copies it with the address
  return those.length > 0;
}

keepSecrets();
addEventListener("hashchange", () => keepSecrets() && location.reload());
const page = await import(start.script);
page.show(document.getElementById("main"), ...start.parameters);
