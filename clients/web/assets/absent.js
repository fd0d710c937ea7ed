// What stands at an address that has no page.
import { h } from "./dom.js";

export function show(main) {
  document.title = "No such page - Arena";
  main.append(h("h1", {}, "There is no such page"),
    h("p", { class: "state" }, `Nothing stands at ${location.pathname}. `, h("a", { href: "/" }, "To the lobby")));
}
