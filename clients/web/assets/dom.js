// Elements, made of plain data. Whatever comes from elsewhere becomes text here, never markup.

/** Make an element: `h("a", {href: "/"}, "text", child)`; null children are left out. */
export function h(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name.startsWith("aria-")) element.setAttribute(name, value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value != null) element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((child) => child != null));
  return element;
}

/** Put other children into an element; nothing is touched if they would look alike, so that focus and selection stay. */
export function fill(element, ...children) {
  const fresh = document.createElement(element.tagName);
  fresh.append(...children.flat().filter((child) => child != null));
  if (fresh.childNodes.length === element.childNodes.length) {
    const pairs = [...fresh.childNodes].map((node, index) => [node, element.childNodes[index]]);
    if (pairs.every(([one, other]) => one.isEqualNode(other))) return;
  }
  element.replaceChildren(...fresh.childNodes);
}

/** Set text, if it is another: what is set again is read out again. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** What the server gave this page: its script, its parameters, and the routes of `clients/web/routes.py`. */
export const start = JSON.parse(document.getElementById("main").dataset.start);

/** The path of a route: `{name}` is filled from `values`, and what is left of them becomes the query. */
export function route(name, values = {}) {
  const query = new URLSearchParams(values);
  const path = start.routes[name].replace(/\{(\w+)\}/g, (_, key) => {
    query.delete(key);
    return encodeURIComponent(values[key]);
  });
  return query.size ? `${path}?${query}` : path;
}

/** Ask the server, and return what it answers, a Blob if that is no JSON; {error} if it does not answer. */
export async function ask(path, options = {}) {
  try {
    const answer = await fetch(path, options);
    if (!answer.ok) return { error: `the web server answers ${answer.status}` };
    return answer.headers.get("content-type")?.startsWith("application/json") ? await answer.json() : await answer.blob();
  } catch {
    return { error: "the web server does not answer; is arena web still running?" };
  }
}

/** Open a WebSocket of this server. `hear` gets each message, `lose` is data when it is gone. */
export function connect(path, first, hear, lose) {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}`);
  socket.onopen = () => socket.send(JSON.stringify(first));
  socket.onmessage = (event) => hear(JSON.parse(event.data));
  socket.onclose = () => lose();
  return socket;
}

export const words = (text) => text.replaceAll("_", " ");
export const signed = (number) => (number > 0 ? `+${number}` : `${number}`).replace("-", "\u2212");

/** Say how a match ended, for everyone. */
export function formatEnding(ending) {
  const who = ending.winner === null ? (ending.ending === "void" ? "void" : "a draw") : `${ending.winner} wins`;
  const why = ending.reason ? ` (${ending.reason})` : "";
  return `${who} by ${words(ending.ending)}${why} after ${ending.ticks} ticks, score ${signed(ending.score)} for blue`;
}

/** Where the spectator key is kept: in this tab alone, and in no address. */
export const spectatorKey = {
  get: () => sessionStorage.getItem("spectator-key") ?? "",
  set: (key) => (key ? sessionStorage.setItem("spectator-key", key) : sessionStorage.removeItem("spectator-key")),
};

/** Where the token of an entry's owner is kept: for this page, in this tab alone. */
export const ownerToken = {
  name: () => `owner-token ${location.pathname}`,
  get: () => sessionStorage.getItem(ownerToken.name()) ?? "",
  set: (token) => (/^[\w-]+$/.test(token) ? sessionStorage.setItem(ownerToken.name(), token) : sessionStorage.removeItem(ownerToken.name())),
};
