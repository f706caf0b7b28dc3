"use strict";
// Curves of shots on a canvas, drawn from overviews: the lowest and the highest sample of each column of the screen.
const Curves = (() => {
  const HUES = ["0,114,178", "213,94,0", "0,158,115", "204,121,167", "86,180,233", "185,35,85", "230,159,0", "110,120,135"];
  const BRIGHT = { "0,114,178": "70,165,235", "185,35,85": "242,95,145" }; // too dark for a dark page
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const hue = (k) => { const rgb = HUES[k % HUES.length]; return `rgb(${dark.matches ? BRIGHT[rgb] ?? rgb : rgb})`; };
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const HIDDEN = /[\u0000-\u001f\u007f-\u009f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff\ufff9-\ufffb]/g;

  // what a browser would obey in a text out of a file, such as a mark that turns the rest of a line round, is spelled
  const visible = (text) => String(text ?? "").replace(HIDDEN, (c) => "\\u" + c.charCodeAt(0).toString(16).padStart(4, "0"));

  const element = (name, attributes, ...inside) => {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes ?? {})) if (value != null && value !== false) made.setAttribute(key, value);
    made.append(...inside.map((one) => (one instanceof Node ? one : visible(one))));
    return made;
  };

  const PREFIXES = new Map([[-3, "n"], [-2, "µ"], [-1, "m"], [0, ""], [1, "k"], [2, "M"], [3, "G"]]);
  const takesPrefix = (unit) => /^(?!kg)\p{L}+(?![\^0-9\p{L}])/u.test(unit);
  // power of a thousand in which a size is written
  const powerOf = (size, unit) => (!(size > 0) || !takesPrefix(unit) ? 0 : Math.max(-3, Math.min(3, Math.floor(Math.log10(size * 1.000001) / 3))));
  const unitOf = (unit, power) => PREFIXES.get(power) + unit.replaceAll("^", "");
  const plain = (value, digits) => {
    const places = Math.max(0, digits - 1 - Math.floor(Math.log10(Math.abs(value) || 1)));
    return value.toFixed(Math.min(places, 9)).replace("-", "\u2212");
  };
  // the rig's own units, where it chose some: {quantity, unit, si_per_unit}
  const QUANTITY = { Pa: "pressure", "m/s^2": "acceleration", "m/s": "velocity", m: "displacement", N: "force", "rad/s": "angular_rate", "rad/s^2": "angular_acceleration" };
  let chosen = [];
  const choose = (units) => { chosen = units ?? []; };
  const choice = (unit) => chosen.find((one) => one.quantity === QUANTITY[unit] && one.si_per_unit > 0);
  const engineering = (value, unit, digits = 3) => {
    if (value == null || !Number.isFinite(value)) return "–";
    const own = choice(unit);
    if (own) return `${plain(value / own.si_per_unit, digits)} ${own.unit}`;
    const power = powerOf(Math.abs(Number(value.toPrecision(digits))), unit);
    return `${plain(value / 1000 ** power, digits)} ${unitOf(unit, power)}`.trim();
  };

  // scripts of the folder, each read once for each state of what it was made of
  const reading = new Map();
  const read = (path, digest) => {
    const address = path + "?" + digest;
    if (!reading.has(address)) reading.set(address, new Promise((done, failed) => {
      const script = document.createElement("script");
      script.src = address;
      script.onload = () => { script.remove(); done(); };
      script.onerror = () => { script.remove(); reading.delete(address); failed(new Error(path)); };
      document.head.append(script);
    }));
    return reading.get(address);
  };

  const numbers = (text) => {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    return new Float32Array(bytes.buffer);
  };
  const opened = new WeakMap();
  const open = (pieces) => {
    if (!opened.has(pieces)) {
      const low = numbers(pieces.low);
      opened.set(pieces, {
        first: pieces.first_s, step: pieces.step_s, low, high: pieces.high == null ? low : numbers(pieces.high),
        times: pieces.times == null ? null : numbers(pieces.times), count: low.length,
      });
    }
    return opened.get(pieces);
  };
  const timeOf = (open, i) => open.first + (open.times ? open.times[i] : open.step * i);
  // the first piece at or behind an instant
  const at = (open, time) => {
    if (!open.times) return Math.max(0, Math.min(open.count, Math.ceil((time - open.first) / (open.step || 1))));
    let low = 0, high = open.count;
    while (low < high) { const middle = (low + high) >> 1; if (timeOf(open, middle) < time) low = middle + 1; else high = middle; }
    return low;
  };

  // lowest and highest of what is in each column, between two instants; one piece more on either side, so that lines go on
  const columns = (pieces, zero, from, to, width) => {
    const one = open(pieces), first = Math.max(0, at(one, from + zero) - 1), end = Math.min(one.count, at(one, to + zero) + 1);
    const x = [], low = [], high = [], scale = width / (to - from);
    if (end - first <= 2 * width) {
      for (let i = first; i < end; i++) { x.push((timeOf(one, i) - zero - from) * scale); low.push(one.low[i]); high.push(one.high[i]); }
      return { x, low, high, count: end - first };
    }
    for (let k = 0, i = first; k < width; k++) {
      const until = k === width - 1 ? end : Math.min(end, at(one, from + zero + (k + 1) / scale));
      let least = Infinity, most = -Infinity;
      for (; i < until; i++) { if (one.low[i] < least) least = one.low[i]; if (one.high[i] > most) most = one.high[i]; }
      if (least <= most) { x.push(k + 0.5); low.push(least); high.push(most); } else { x.push(k + 0.5); low.push(NaN); high.push(NaN); }
    }
    return { x, low, high, count: end - first };
  };

  const ticks = (from, to, most) => {
    const raw = (to - from) / most, power = 10 ** Math.floor(Math.log10(raw)), share = raw / power;
    const step = power * (share <= 1 ? 1 : share <= 2 ? 2 : share <= 5 ? 5 : 10), found = [];
    for (let k = Math.ceil(from / step - 1e-9); k * step <= to + 1e-9 * step; k++) found.push(k * step);
    return { found, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  };
  const LEFT = 62, RIGHT = 8, TOP = 8, BOTTOM = 24;

  // Draws curves, {pieces, zero, style, wide, alpha}, between two instants; returns the unit in which it labels them.
  const draw = (canvas, curves, unit, from, to, marks = []) => {
    const ratio = window.devicePixelRatio || 1, wide = canvas.clientWidth, tall = canvas.clientHeight;
    if (!wide || !tall || !(to > from)) return unitOf(unit, 0);
    if (canvas.width !== Math.round(wide * ratio) || canvas.height !== Math.round(tall * ratio)) {
      canvas.width = Math.round(wide * ratio);
      canvas.height = Math.round(tall * ratio);
    }
    const pen = canvas.getContext("2d"), width = Math.max(10, Math.floor(wide - LEFT - RIGHT)), height = tall - TOP - BOTTOM;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, wide, tall);
    const drawn = curves.map((curve) => columns(curve.pieces, curve.zero, from, to, width));
    let least = Infinity, most = -Infinity;
    for (const one of drawn) for (let i = 0; i < one.x.length; i++) {
      if (one.low[i] < least) least = one.low[i];
      if (one.high[i] > most) most = one.high[i];
    }
    if (!(least <= most) || !Number.isFinite(most - least)) [least, most] = [0, 1];
    if (least === most) [least, most] = [least - Math.abs(least) / 2 - 1e-9, most + Math.abs(most) / 2 + 1e-9];
    const margin = 0.05 * (most - least), power = powerOf(Math.max(Math.abs(least), Math.abs(most)), unit), own = choice(unit);
    least -= margin; most += margin;
    const y = (value) => TOP + height * (most - value) / (most - least);
    pen.font = `11.5px ${getComputedStyle(document.body).fontFamily}`;
    pen.lineWidth = 1;
    pen.strokeStyle = colour("--rule"); pen.fillStyle = colour("--soft");
    pen.textAlign = "right"; pen.textBaseline = "middle";
    const scale = own ? own.si_per_unit : 1000 ** power, rows = ticks(least / scale, most / scale, Math.max(2, height / 34));
    pen.beginPath();
    for (const value of rows.found) {
      const at = Math.round(y(value * scale)) + 0.5;
      pen.moveTo(LEFT, at); pen.lineTo(LEFT + width, at);
      pen.fillText(value.toFixed(rows.decimals).replace("-", "\u2212"), LEFT - 6, at);
    }
    pen.textBaseline = "alphabetic"; pen.textAlign = "center";
    const milli = to - from < 2 ? 1000 : 1, instants = ticks(from * milli, to * milli, Math.max(2, width / 90));
    instants.found.forEach((value, k) => {
      const at = Math.round(LEFT + width * (value / milli - from) / (to - from)) + 0.5;
      pen.moveTo(at, TOP); pen.lineTo(at, TOP + height);
      const last = k === instants.found.length - 1 ? (milli === 1000 ? " ms" : " s") : "";
      const text = value.toFixed(instants.decimals).replace("-", "\u2212") + last, half = pen.measureText(text).width / 2;
      pen.fillText(text, Math.max(half, Math.min(at, wide - half)), tall - 7);
    });
    pen.stroke();
    pen.strokeStyle = colour("--soft");
    pen.strokeRect(LEFT + 0.5, TOP + 0.5, width, height);
    pen.save();
    pen.beginPath(); pen.rect(LEFT, TOP, width, height); pen.clip();
    pen.lineJoin = "bevel";
    drawn.forEach((one, k) => {
      const curve = curves[k];
      pen.strokeStyle = curve.style; pen.lineWidth = curve.wide ?? 1.3; pen.globalAlpha = curve.alpha ?? 1;
      pen.beginPath();
      let on = false;
      for (let i = 0; i < one.x.length; i++) {
        const x = LEFT + one.x[i], low = y(one.low[i]), high = y(one.high[i]);
        if (!(Number.isFinite(low) && Number.isFinite(high))) { on = false; continue; }
        if (on) pen.lineTo(x, low); else pen.moveTo(x, low);
        if (high !== low) pen.lineTo(x, high); else if (!on) pen.lineTo(x + 0.01, low);
        on = true;
      }
      pen.stroke();
    });
    pen.globalAlpha = 1;
    for (const mark of marks) {
      pen.strokeStyle = mark.style; pen.lineWidth = 1;
      const x = LEFT + width * (mark.time - from) / (to - from);
      pen.beginPath(); pen.moveTo(x, TOP); pen.lineTo(x, TOP + height); pen.stroke();
    }
    pen.restore();
    return own ? own.unit : unitOf(unit, power);
  };
  return { HUES, LEFT, RIGHT, hue, colour, visible, element, choose, engineering, unitOf, read, open, columns, draw, dark, timeOf };
})();
