// Where the pages of seasons are, and times as their reader's clock has them.
import { h } from "./dom.js";

const [DAY_S, HOUR_S, MINUTE_S] = [86_400, 3_600, 60];

export const seasonAddress = (season) => `/seasons/${encodeURIComponent(season)}`;
export const entryAddress = (season, entry) => `${seasonAddress(season)}/${encodeURIComponent(entry)}`;

/** Links to seasons; nothing if there are none. */
export function listSeasons(seasons) {
  if (!seasons.length) return null;
  const links = seasons.flatMap((name, index) => [index ? ", " : "", h("a", { href: seasonAddress(name) }, name)]);
  return h("p", {}, seasons.length > 1 ? "Seasons: " : "Season: ", ...links);
}

/** A time, given in seconds since 1970. */
export function time(seconds) {
  const date = new Date(1000 * seconds);
  return h("time", { datetime: date.toISOString() }, date.toLocaleString([], { dateStyle: "medium", timeStyle: "short" }));
}

/** How long it is until a time, as in 2 d 03:04:05; nothing once it has come. */
export function formatTimeLeft(seconds) {
  const left = Math.ceil(seconds - Date.now() / 1000);
  if (left <= 0) return "";
  const clock = [left % DAY_S / HOUR_S, left % HOUR_S / MINUTE_S, left % MINUTE_S].map((part) => `${Math.floor(part)}`.padStart(2, "0")).join(":");
  return left >= DAY_S ? `${Math.floor(left / DAY_S)} d ${clock}` : clock;
}
