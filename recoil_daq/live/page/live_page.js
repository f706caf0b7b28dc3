"use strict";
// The range as live.js says it, read anew each second; how old that is is told by this browser's own clock.
(() => {
  const EVERY_MS = 1000, SOON_MS = 350, STALE_MS = 2000, BEFORE = 5;
  const { element, engineering, visible } = Curves;
  const of = (id) => document.getElementById(id);
  const now = () => performance.now();
  of("page").hidden = false;

  // ---- age: never by the other computer's clock against this one, which may differ by hours
  let state = null, utc = "", moved = false, offset = Infinity, looked = now(), seen = now();
  const take = (read) => {
    const at = now();
    if (!read || typeof read !== "object" || read.schema !== "recoil-daq/live/1") return;
    const changed = read.utc !== utc;
    if (changed && utc) moved = true;
    if (changed) {
      // it was written since the last look, whatever the clocks say, and by whichever session
      offset = Math.max(Math.min(offset, at - 1000 * read.armed_s), looked - 1000 * read.armed_s);
      seen = Math.max(seen, utc ? 1000 * read.armed_s + offset : at);
      utc = read.utc; state = read;
      render();
    }
    looked = at;
    age();
  };
  const age = () => {
    const ended = state?.state === "stopped", old = now() - seen, stale = !ended && old > STALE_MS;
    document.documentElement.toggleAttribute("data-stale", stale);
    document.documentElement.toggleAttribute("data-unsure", !ended && !moved);
    of("stale").hidden = !stale;
    if (stale) of("stale").textContent = state
      ? `STALE: nothing new for ${(old / 1000).toFixed(0)} s. The session, its computer or the way to it stands still: what is below is of then, ${clock(utc)}`
      : "STALE: no live.js can be read beside this page: no session writes here";
    if (stale) document.title = "STALE · live range";
    else if (state) document.title = `${WORDS[state.state] ?? state.state} · ${visible(state.rig)}`;
  };
  const WORDS = { armed: "ARMED", recording: "RECORDING", disarmed: "DISARMED", stopped: "ENDED" };
  const clock = (text) => String(text).slice(11, 19) + " UTC";

  const poll = () => {
    const script = document.createElement("script");
    script.src = "live.js?" + Date.now().toString(36);
    script.onload = () => { script.remove(); take(window.live); };
    script.onerror = () => { script.remove(); age(); };
    document.head.append(script);
  };
  poll();
  setTimeout(poll, SOON_MS); // whether it moves at all
  setInterval(poll, EVERY_MS);
  setInterval(age, 200);
  document.addEventListener("visibilitychange", () => { if (!document.hidden) poll(); });

  // ---- what is shown; a part is made anew only where it changed, so that a marked text stays marked
  const made = new Map();
  const fill = (id, what, make) => {
    const key = JSON.stringify(what);
    if (made.get(id) === key) return;
    made.set(id, key);
    of(id).replaceChildren(...make(what).map((one) => (one instanceof Node ? one : visible(one))));
  };
  const say = (id, text, hidden = !text) => {
    const shown = visible(text);
    if (of(id).textContent !== shown) of(id).textContent = shown;
    of(id).hidden = hidden;
  };
  const KIND = { "usable": "ok", "record only": "doubt", "not usable": "bad", "not whole": "bad", "failed": "bad", "incomplete": "doubt" };
  const SAID = { "record only": "FOR THE RECORD ONLY", "cutting": "CAPTURED", "converting": "BEING CONVERTED" };
  const kind = (shot) => KIND[shot.state] ?? "way";
  const word = (shot) => SAID[shot.state] ?? String(shot.state).toUpperCase();
  const mass = (found) => {
    const [low, high] = found.U95, places = Math.max(1, 1 - Math.floor(Math.log10(found.u > 0 ? found.u : 1)));
    const text = (value) => (value == null ? "–" : value.toFixed(places));
    return { value: text(found.value), half: text(low == null || high == null ? null : (high - low) / 2), low: text(low), high: text(high) };
  };
  const report = (shot) => `reports/${encodeURIComponent(shot.shot)}/report.html`;

  const sourceState = (one) => {
    if (one.state === "live") return ["ok", state.state === "recording" ? "recording" : "live"];
    if (one.state === "not understood") return ["doubt", "bytes, none of them good"];
    if (["silent", "lost"].includes(one.state)) return ["bad", one.state];
    if (one.state === "stopped" && (state.state !== "stopped" || one.error)) return ["bad", "stopped"];
    if (one.awaited.length) return ["doubt", `waits for the file of ${one.awaited.join(", ")}`];
    return ["rest", one.state === "for files" ? "no file awaited" : one.state];
  };

  const render = () => {
    Curves.choose(state.units);
    say("rig", state.rig); of("virtual").hidden = !state.virtual;
    say("utc", clock(state.utc));
    of("state").textContent = WORDS[state.state] ?? visible(state.state).toUpperCase();
    of("now").dataset.state = state.state;
    say("next", state.next_shot); of("next").parentElement.hidden = state.state === "stopped";
    const step = state.next_step;
    say("alert", state.alert, !state.alert || state.alert === step.text);
    of("step").dataset.kind = step.kind;
    fill("step", step.text, (text) => [element("span", {}, "Next: "), text]);
    fill("sources", state.sources.map((one) => [one.name, ...sourceState(one), one.losses ?? "", one.growing, one.left_s == null ? null : Math.round(one.left_s)]),
      (rows) => rows.map(([name, mark, text, losses, growing, left]) => element("li", { class: mark }, element("b", {}, name), " ", element("span", { class: "how" }, text),
        losses && !losses.startsWith("none") ? element("span", { class: "lost" }, ` lost: ${losses}`) : "",
        ...growing.map((file) => element("span", { class: "lost" }, ` ${file.file} grows, ${engineering(file.bytes, "B")}`)),
        left == null ? "" : element("span", { class: "lost" }, `, ${left} s left`))));
    fill("cautions", state.cautions, (texts) => texts.map((text) => element("li", {}, text)));
    const last = state.shots.at(-1) ?? null;
    fill("verdict", last && [last.shot, last.state, last.why, last.reasons, last.warnings, last.mass, last.mass_to_come, last.provisional, step.text], () => (last ? verdict(last) : []));
    const newest = [...state.shots].reverse();
    fill("table", newest.map((one) => ({ ...one, left_s: null })), () => [element("thead", {}, heads()), element("tbody", {}, ...newest.map(row))]);
    fill("together", state.campaign, together);
    fill("notice-list", [...state.notices].reverse(), (all) => all.map((one) => element("li", {}, element("time", {}, clock(one.utc)), " ", one.text, one.count > 1 ? `, ${one.count} times` : "")));
    of("notices").hidden = !state.notices.length;
    curves();
  };

  const verdict = (shot) => {
    const warned = shot.state === "usable" && shot.warnings.length ? `, ${shot.warnings.length} warning${shot.warnings.length > 1 ? "s" : ""}` : "";
    const parts = [element("div", { class: "word " + kind(shot) }, `${shot.shot} `, element("b", {}, word(shot)), element("small", {}, warned))];
    if (shot.mass) {
      const text = mass(shot.mass);
      parts.push(element("div", { class: "mass" + (shot.mass.valid ? "" : " bad") }, `${text.value} `, element("small", {}, `± ${text.half} kg`),
        element("span", { class: "measure" }, `95 %: ${text.low} to ${text.high} kg`, shot.mass.E_n == null ? "" : `, E_n ${shot.mass.E_n.toFixed(1).replace("-", "\u2212")}`, ", ",
          element("b", { class: shot.mass.valid ? "ok" : "bad" }, shot.mass.valid ? "VALID" : "NOT VALID"), shot.provisional ? ", provisional" : "", shot.mass.bare ? ", specification as bare rig" : "")));
    } else if (shot.mass_to_come) parts.push(element("div", { class: "mass to-come" }, "mass to come"));
    const why = [...(shot.mass && !shot.mass.valid ? [`mass not valid: ${shot.mass.reason}`] : []), ...(shot.reasons.length ? shot.reasons : shot.state === "usable" ? [] : [shot.why])].filter(Boolean);
    const more = why.length > 1 ? [element("details", {}, element("summary", {}, `${why.length - 1} more`), element("ul", { class: "notes" }, ...why.slice(1).map((text) => element("li", {}, text))))] : [];
    // what the next step says is not said twice
    if (why.length && !state.next_step.text.endsWith(why[0])) parts.push(element("p", { class: "why " + kind(shot) }, why[0]));
    parts.push(...more);
    if (shot.warnings.length) parts.push(element("details", {}, element("summary", {}, `${shot.warnings.length} warning${shot.warnings.length > 1 ? "s" : ""}`), element("ul", { class: "notes" }, ...shot.warnings.map((text) => element("li", {}, text)))));
    return parts;
  };

  const heads = () => element("tr", {}, ...["Shot", "Verdict", "Peak", "Stroke", "v max", "Mass, kg", "Report"].map((text, k) => element("th", { class: k > 1 && k < 6 ? "n" : null }, text)));
  const row = (shot) => {
    const figure = (...codes) => { const one = shot.figures.find((f) => codes.includes(f.code)); return one ? engineering(one.value, one.unit) : ""; };
    const text = shot.mass ? mass(shot.mass) : null;
    const found = text ? `${text.value} ± ${text.half}` + (shot.mass.valid ? shot.provisional ? " provisional" : "" : " NOT VALID") : shot.mass_to_come ? "to come" : "";
    const cell = (head, name, ...inside) => element("td", { class: name, "data-h": head }, ...inside);
    return element("tr", {}, cell("", "name", shot.shot),
      cell("", "", element("span", { class: "chip " + { ok: "ok", doubt: "warn", bad: "", way: "way" }[kind(shot)] }, word(shot)), shot.excluded ? ` excluded: ${shot.excluded}` : shot.why && shot.state !== "usable" ? ` ${shot.why}` : ""),
      cell("Peak", "n", figure("breech", "drive")), cell("Stroke", "n", figure("stroke")), cell("v max", "n", figure("v max")), cell("Mass, kg", "n", found),
      cell("", "", shot.mass ? element("a", { href: report(shot) }, "report") : ""));
  };
  const together = (all) => {
    if (!all) return [];
    const text = mass(all);
    return [`${all.shots.length} shots together: ${text.value} ± ${text.half} kg, ${all.changes.length ? all.changes.join("; ") : "nothing changed"}` + (all.valid ? "" : `; NOT VALID: ${all.reason}`)];
  };

  // ---- curves of the last shot that has some, over those before it
  const FILTERED = { breech_pressure: "breech_pressure_pa", brake_pressure: "brake_pressure_pa", recuperator_pressure: "recuperator_pressure_pa", recoil_acceleration: "recoil_acceleration_m_s2", recoil_displacement: "recoil_travel_m" };
  const SHOWN = (role) => role.endsWith("_pressure") || role.endsWith("_force") || ["recoil_acceleration", "recoil_displacement", "recoil_velocity"].includes(role);
  let drawing = "", panels = [];
  const curves = () => {
    const there = state.shots.filter((shot) => shot.overview);
    const last = there.at(-1), key = JSON.stringify(there.slice(-BEFORE - 1).map((shot) => [shot.shot, shot.overview, shot.mass?.value]));
    if (!last || key === drawing) return;
    drawing = key;
    Promise.allSettled(there.slice(-BEFORE - 1).map(load)).then((read) => { if (drawing === key) lay(last, read.filter((one) => one.value).map((one) => one.value)); });
  };
  const load = async (shot) => {
    const folder = `overviews/${encodeURIComponent(shot.shot)}/`;
    await Curves.read(folder + "overview.js", shot.overview);
    if (shot.mass) await Curves.read(folder + "filtered.js", shot.overview + shot.mass.value).catch(() => null);
    const found = window.overviews[shot.shot], filtered = shot.mass ? window.filtered?.[shot.shot] : null;
    return { shot, channels: found.channels, zero: filtered?.zero_s ?? found.zero_s ?? null, filtered };
  };
  const lay = (last, loaded) => {
    const newest = loaded.find((one) => one.shot === last || one.shot.shot === last.shot);
    if (!newest) return;
    of("last").hidden = false;
    say("last-name", `Shot ${last.shot}`);
    const zero = (one, channel) => one.zero ?? Curves.open(channel.pieces).first;
    const roles = [...new Set(newest.channels.filter((c) => SHOWN(c.role) && c.aligned && c.samples).map((c) => c.role))];
    if (newest.filtered && !roles.includes("recoil_displacement")) roles.push("recoil_displacement");
    const span = newest.filtered ? Curves.open(asPieces(newest.filtered, "recoil_acceleration_m_s2") ?? asPieces(newest.filtered, "time_s")) : null;
    const [from, to] = span ? [span.times[0], span.times.at(-1)] : [-0.02, 0.3];
    panels = roles.map((role) => {
      const list = [], of_role = (one) => one.channels.find((c) => c.role === role && c.aligned && c.samples);
      const smooth = (one) => (one.filtered && FILTERED[role] ? asPieces(one.filtered, FILTERED[role]) : null);
      for (const one of loaded) if (one !== newest) {
        const channel = of_role(one), behind = smooth(one);
        if (behind) list.push({ pieces: behind, zero: 0, name: "--soft", wide: 1, alpha: 0.5 });
        else if (channel) list.push({ pieces: channel.pieces, zero: zero(one, channel), name: "--soft", wide: 1, alpha: 0.35 });
      }
      const channel = of_role(newest), behind = smooth(newest);
      // travel by the camera is measured from elsewhere: only what is told of the same zero is laid together
      if (channel && !(role === "recoil_displacement" && behind)) list.push({ pieces: channel.pieces, zero: zero(newest, channel), name: "--accent", wide: behind ? 1 : 1.6, alpha: behind ? 0.4 : 1 });
      if (behind) list.push({ pieces: behind, zero: 0, name: "--accent", wide: 2, alpha: 1 });
      const unit = channel?.unit ?? "m", canvas = element("canvas", { role: "img", "aria-label": `${role.replaceAll("_", " ")} of shot ${last.shot} over time` });
      const caption = element("figcaption", {}, role === "recoil_displacement" && behind ? "recoil travel" : role.replaceAll("_", " "));
      return { canvas, caption, list, unit, from, to, place: element("figure", {}, caption, canvas), title: caption.textContent };
    }).filter((panel) => panel.list.length);
    of("panels").replaceChildren(...panels.map((panel) => panel.place));
    paint();
    const table = last.mass?.peaks ?? {}, u = last.mass?.peaks_u ?? {};
    const unit = (key) => [["_m_s2", "m/s^2"], ["_m_s", "m/s"], ["_n_s", "N s"], ["_pa", "Pa"], ["_n", "N"], ["_m", "m"], ["_s", "s"]].find(([end]) => key.endsWith(end)) ?? ["", ""];
    of("peaks").replaceChildren(...Object.entries(table).map(([key, value]) => {
      const [end, symbol] = unit(key), name = key.slice(0, key.length - end.length).replaceAll("_", " ");
      return element("div", {}, element("dt", {}, name), element("dd", {}, engineering(value, symbol, 4), Number.isFinite(u[key]) ? element("small", {}, ` u ${engineering(u[key], symbol, 2)}`) : ""));
    }));
  };
  const asPieces = (filtered, name) => {
    if (!filtered.curves[name]) return null;
    filtered.pieces ??= {};
    return (filtered.pieces[name] ??= { first_s: 0, step_s: 0, times: filtered.curves.time_s, low: filtered.curves[name], high: null });
  };
  const paint = () => {
    for (const panel of panels) {
      const unit = Curves.draw(panel.canvas, panel.list.map((one) => ({ ...one, style: Curves.colour(one.name) })), panel.unit, panel.from, panel.to);
      panel.caption.textContent = visible(`${panel.title}, ${unit}`);
    }
  };
  window.addEventListener("resize", paint);
  Curves.dark.addEventListener("change", paint);
})();
