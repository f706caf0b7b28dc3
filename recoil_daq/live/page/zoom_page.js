"use strict";
// Any channels of any shots of the folder over one another, from their overviews; zoomed, from all that is kept of them.
(() => {
  const { element, engineering, visible } = Curves;
  const of = (id) => document.getElementById(id);
  const shots = Array.isArray(window.shots) ? window.shots : [];
  const FIRST = ["_pressure", "_force", "recoil_acceleration", "recoil_velocity"], MOST_FIRST = 6;
  const loaded = new Map(), chosenShots = new Set(), chosenChannels = new Set(), fine = new Map();
  let panels = [], whole = [0, 1], shown = [0, 1], asked = 0, reached = new Set();

  const folder = (shot) => `overviews/${encodeURIComponent(shot)}/`;
  const say = (text) => { of("told").textContent = visible(text); };
  const picked = (name) => document.querySelector(`input[name=${name}]:checked`).value;

  const box = (name, on, change) => {
    const input = element("input", { type: "checkbox", value: name });
    input.checked = on;
    input.addEventListener("change", () => change(input.checked));
    return element("label", {}, input, " ", name);
  };

  const load = async (shot) => {
    if (loaded.has(shot.shot)) return;
    await Curves.read(folder(shot.shot) + "overview.js", shot.sha256);
    loaded.set(shot.shot, window.overviews[shot.shot]);
    Curves.choose(window.overviews[shot.shot].units);
  };
  const choose = async () => {
    const turn = ++asked;
    const read = await Promise.allSettled(shots.filter((one) => chosenShots.has(one.shot)).map(load));
    if (turn !== asked) return;
    const failed = read.filter((one) => one.status === "rejected").length;
    say(failed ? `${failed} of these shots cannot be read` : "");
    list(); lay();
  };

  // the channels of the chosen shots, in the order of the rig
  const list = () => {
    const names = new Map();
    for (const name of chosenShots) for (const one of loaded.get(name)?.channels ?? []) if (!names.has(one.name)) names.set(one.name, one);
    if (!chosenChannels.size) {
      const first = [...names.values()].filter((one) => FIRST.some((end) => one.role.endsWith(end)));
      for (const one of (first.length ? first : [...names.values()]).slice(0, MOST_FIRST)) chosenChannels.add(one.name);
    }
    of("channels").replaceChildren(...[...names.keys()].map((name) => box(name, chosenChannels.has(name), (on) => { chosenChannels[on ? "add" : "delete"](name); lay(); })));
  };

  const lay = () => {
    const curves = [];
    for (const name of [...chosenShots].sort()) {
      const one = loaded.get(name);
      for (const channel of one?.channels ?? []) if (chosenChannels.has(channel.name) && channel.samples) {
        const first = Curves.open(channel.pieces), start = Curves.timeOf(first, 0), end = Curves.timeOf(first, first.count - 1);
        // a clock that is not aligned has no instant of the others': its record begins where theirs does
        const zero = picked("zero") === "onset" ? (channel.aligned ? one.zero_s ?? start : start) : channel.aligned ? 0 : start;
        curves.push({ shot: name, channel, zero, from: start - zero, to: end - zero, pieces: channel.pieces, label: `${name} ${channel.name}${channel.aligned ? "" : " (clock not aligned)"}` });
      }
    }
    const part = (one) => (picked("figure") === "unit" ? one.channel.unit : one.channel.name);
    panels = [...new Set(curves.map(part))].map((name) => {
      const own = curves.filter((one) => part(one) === name), unit = own[0].channel.unit;
      own.forEach((one, k) => { one.number = k; });
      const caption = element("figcaption", {}), canvas = element("canvas", { tabindex: 0, role: "img", "aria-label": `${own.map((one) => one.label).join(", ")} over time` });
      listen(canvas);
      return { unit, own, canvas, caption, place: element("figure", {}, caption, canvas) };
    });
    whole = curves.length ? [Math.min(...curves.map((one) => one.from)), Math.max(...curves.map((one) => one.to))] : [0, 1];
    shown = [...whole];
    of("panels").replaceChildren(...panels.map((one) => one.place));
    for (const panel of panels) panel.caption.replaceChildren(element("b", {}, ""), ...panel.own.map((one) => {
      const mark = element("b", { class: "mark" }), label = element("span", { class: "label" }, mark, one.label);
      one.mark = mark;
      return label;
    }));
    paint();
  };

  // ---- what is zoomed is drawn at once from what is there, and anew when the rest was read
  const detailed = (curve) => {
    const key = `${curve.shot}/${curve.channel.fine}`;
    if (!curve.channel.fine) return curve.channel.pieces;
    const coarse = Curves.open(curve.channel.pieces), pieces = (shown[1] - shown[0]) / (coarse.step || 1);
    if (pieces > of("panels").clientWidth) return curve.channel.pieces;
    if (fine.has(key)) return fine.get(key) ?? curve.channel.pieces;
    fine.set(key, null);
    Curves.read(folder(curve.shot) + curve.channel.fine, loaded.get(curve.shot).sha256).then(() => {
      fine.set(key, window.fine[key].pieces);
      paint();
    }, () => { say(`${curve.label}: what is kept in more detail cannot be read`); });
    return curve.channel.pieces;
  };
  let planned = false;
  const paint = () => {
    if (planned) return;
    planned = true;
    requestAnimationFrame(() => {
      planned = false;
      let coarsest = 1;
      for (const panel of panels) {
        const curves = panel.own.map((one) => {
          const pieces = detailed(one);
          coarsest = Math.max(coarsest, Math.round(one.channel.samples / Curves.open(pieces).count));
          return { pieces, zero: one.zero, style: Curves.hue(one.number), wide: 1.3 };
        });
        const drag = panel.drag ? panel.drag.map((time) => ({ time, style: Curves.colour("--accent") })) : [];
        const unit = Curves.draw(panel.canvas, curves, panel.unit, ...shown, drag);
        panel.caption.firstChild.textContent = visible(`${unit || "1"} `);
        for (const one of panel.own) one.mark.style.background = Curves.hue(one.number);
      }
      of("shown").textContent = panels.length ? `${engineering(shown[0], "s", 4)} to ${engineering(shown[1], "s", 4)}` : "choose shots and channels";
      of("detail").textContent = coarsest > 1 ? `Each point stands for up to ${coarsest} samples, with the lowest and the highest of them.` : "Every sample is drawn.";
      document.documentElement.dataset.painted = String(Number(document.documentElement.dataset.painted ?? 0) + 1);
    });
  };

  const LEAST_S = 1e-6;
  const show = (from, to) => {
    const span = Math.max(LEAST_S, Math.min(to - from, whole[1] - whole[0]));
    from = Math.max(whole[0], Math.min(from, whole[1] - span));
    shown = [from, from + span];
    paint();
  };
  const zoom = (factor, share = 0.5) => {
    const at = shown[0] + share * (shown[1] - shown[0]), span = (shown[1] - shown[0]) * factor;
    show(at - share * span, at + (1 - share) * span);
  };
  const move = { in: () => zoom(0.5), out: () => zoom(2), all: () => show(...whole),
    left: () => show(shown[0] - 0.25 * (shown[1] - shown[0]), shown[1] - 0.25 * (shown[1] - shown[0])),
    right: () => show(shown[0] + 0.25 * (shown[1] - shown[0]), shown[1] + 0.25 * (shown[1] - shown[0])) };
  const KEYS = { "+": "in", "=": "in", "-": "out", "\u2212": "out", ArrowLeft: "left", ArrowRight: "right", 0: "all" };
  const listen = (canvas) => {
    const panel = () => panels.find((one) => one.canvas === canvas);
    const share = (event) => (event.offsetX - Curves.LEFT) / (canvas.clientWidth - Curves.LEFT - Curves.RIGHT);
    const time = (event) => shown[0] + Math.max(0, Math.min(1, share(event))) * (shown[1] - shown[0]);
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(event.deltaY > 0 ? 1.25 : 0.8, Math.max(0, Math.min(1, share(event)))); }, { passive: false });
    canvas.addEventListener("dblclick", () => show(...whole));
    canvas.addEventListener("keydown", (event) => { if (event.key in KEYS && !event.ctrlKey && !event.metaKey) { event.preventDefault(); move[KEYS[event.key]](); } });
    canvas.addEventListener("pointerdown", (event) => { if (event.button === 0) { canvas.setPointerCapture(event.pointerId); panel().drag = [time(event), time(event)]; } });
    canvas.addEventListener("pointermove", (event) => { const one = panel(); if (one.drag) { one.drag = [one.drag[0], time(event)]; paint(); } });
    canvas.addEventListener("pointercancel", () => { panel().drag = null; paint(); });
    canvas.addEventListener("pointerup", (event) => {
      const one = panel();
      if (!one.drag) return;
      const [from, to] = [Math.min(one.drag[0], time(event)), Math.max(one.drag[0], time(event))], wide = (to - from) / (shown[1] - shown[0]);
      one.drag = null;
      if (wide > 0.01) show(from, to); else paint();
    });
  };
  for (const button of document.querySelectorAll("[data-move]")) button.addEventListener("click", () => move[button.dataset.move]());
  for (const input of document.querySelectorAll("input[type=radio]")) input.addEventListener("change", lay);
  window.addEventListener("resize", paint);
  Curves.dark.addEventListener("change", paint);

  const named = decodeURIComponent(location.hash.slice(1)).split(",").filter((name) => shots.some((one) => one.shot === name));
  for (const name of named.length ? named : shots.slice(-1).map((one) => one.shot)) chosenShots.add(name);
  of("shots").replaceChildren(...shots.map((one) => box(one.shot, chosenShots.has(one.shot), (on) => { chosenShots[on ? "add" : "delete"](one.shot); choose(); })));
  if (shots.length) choose(); else say("no overview of a shot is here: `recoil-daq serve DIR` writes those of its shot files");
})();
