// Where in a match a page is, in its address: `?tick=17&view=blue`, so that it can be sent to others.

const EVERY_MS = 400; // browsers refuse a page that changes its address more often for long

let due = null;

/** What the address asks for. */
export function readPlace() {
  const query = new URLSearchParams(location.search);
  const tick = Number.parseInt(query.get("tick") ?? "", 10);
  return { tick: Number.isNaN(tick) ? 0 : Math.max(tick, 0), view: query.get("view") ?? "" };
}

/** Keep a tick in the address, and the view if one was chosen. */
export function keepPlace(tick, view) {
  if (location.protocol === "about:") return; // a page inside another, which has no address of its own
  clearTimeout(due);
  due = setTimeout(() => {
    const query = new URLSearchParams(location.search);
    query.set("tick", tick);
    if (view) query.set("view", view);
    history.replaceState(null, "", `${location.pathname}?${query}${location.hash}`);
  }, EVERY_MS);
}
