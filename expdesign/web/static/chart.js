// Chart and player. Positions come and go in degrees; nothing is computed here but where the hull is drawn.
(() => {
  const COLOURS = { land: "#e3d7bd", forbidden: "#d9a5a0", water: "#dcebf5", track: "#0b5a8a", run: "#c2410c" };
  const DEPTHS = ["#b9d7ea", "#cbe2f0", "#dcebf5", "#e8f2f8", "#f1f7fb"];
  const charts = {};

  const mapOf = (id) => getElement(id).map;

  function styled(layer) {
    if (layer.kind === "land") return { color: "#8a7d5f", weight: 1, fillColor: COLOURS.land, fillOpacity: 1 };
    if (layer.kind === "forbidden") return { stroke: false, fillColor: COLOURS.forbidden, fillOpacity: 0.55 };
    if (layer.kind === "water") return { stroke: false, fillColor: COLOURS.water, fillOpacity: 1 };
    return { stroke: false, fillColor: DEPTHS[Math.min(layer.rank, DEPTHS.length - 1)], fillOpacity: 1 };
  }

  // A hull in degrees around a place; metres to degrees on the sphere, good enough to draw.
  function hull(lat, lng, heading, length, beam) {
    const l = length / 2, b = beam / 2;
    const outline = [[l, 0], [l * 0.6, b], [-l, b], [-l, -b], [l * 0.6, -b]];
    const c = Math.cos(heading), s = Math.sin(heading), metre = 1 / 111200, wide = metre / Math.cos((lat * Math.PI) / 180);
    return outline.map(([x, y]) => [lat + (x * c - y * s) * metre, lng + (x * s + y * c) * wide]);
  }

  async function chart(id, url, ends, editable) {
    const answer = await (await fetch(url)).json();
    const map = mapOf(id);
    const first = !charts[id];
    const mine = (charts[id] = charts[id] || { group: L.layerGroup().addTo(map), places: L.layerGroup().addTo(map), player: null });
    if (first) map.createPane("sea").style.zIndex = 350;  // below tracks and zones, and darker at night
    mine.group.clearLayers();
    if (answer.problem) return;
    answer.layers.forEach((layer, index) => {
      layer.rank = index - 1;
      L.geoJSON(layer.geometry, { pane: "sea", style: () => styled(layer), interactive: false }).addTo(mine.group);
    });
    for (const zone of answer.closed) {
      L.geoJSON(zone.geometry, { style: () => ({ color: "#a3261c", weight: 1, fillOpacity: 0.15 }) })
        .bindTooltip(zone.name).addTo(mine.group);
    }
    answer.zones.forEach((zone, number) => drawZone(id, zone, number, editable));
    if (ends && ends.ends && mine.known !== JSON.stringify(ends)) {  // what is just being dragged stays
      mine.known = JSON.stringify(ends);
      mine.places.clearLayers();
      for (const which of ["start", "goal"]) end(id, which, ends, editable);
    }
    if (first) {
      map.fitBounds(answer.bounds);
      L.control.scale({ imperial: false }).addTo(map);
    }
    getElement(id).$el.setAttribute("data-drawn", answer.corners);
  }

  function drawZone(id, zone, number, editable) {
    const mine = charts[id];
    const layer = L.polygon(zone.polygon, { color: "#a3261c", weight: 2, fillOpacity: 0.2, renderer: L.svg() });
    layer.bindTooltip(zone.name, { permanent: true, direction: "center", className: "zone" }).addTo(mine.group);
    if (!editable) return;
    layer.on("click", () => (layer.editing.enabled() ? layer.editing.disable() : layer.editing.enable()));
    layer.on("edit", () => emitEvent("zone_changed", { number, corners: layer.getLatLngs()[0].map(plain) }));
  }

  const plain = (point) => ({ lat: point.lat, lng: point.lng });

  function pen(id) {
    const map = mapOf(id);
    map.off("draw:created");
    map.on("draw:created", (event) => {
      emitEvent("zone_drawn", event.layer.getLatLngs()[0].map(plain));
      // The last corner goes away under the finger, whose lifting the map then never sees: it would follow the next touch.
      setTimeout(() => { map.dragging.disable(); map.dragging.enable(); });
    });
    new L.Draw.Polygon(map, { allowIntersection: false, shapeOptions: { color: "#a3261c" } }).enable();
  }

  // Start or goal: the hull to scale, a mark that moves it and one ahead of it that turns it.
  function end(id, which, ends, editable) {
    const map = mapOf(id), mine = charts[id], place = ends.ends[which];
    const colour = which === "start" ? "#0a7d4b" : "#7a3ea1";
    const at = { which, lat: place.lat_deg, lng: place.lon_deg, heading: place.heading_deg };
    const body = L.polygon([], { color: colour, weight: 2, fillOpacity: 0.6, interactive: false, renderer: L.svg() }).addTo(mine.places);
    const icon = (name, text) => L.divIcon({ className: `end ${name}`, html: text, iconSize: [28, 28] });
    const mark = L.marker([at.lat, at.lng], { draggable: editable, keyboard: true, title: which, alt: which, icon: icon(which, which === "start" ? "S" : "G") }).addTo(mine.places);
    const turn = L.marker([at.lat, at.lng], { draggable: editable, title: `heading of the ${which}`, alt: `heading of the ${which}`, icon: icon("turn", "") });
    if (editable) turn.addTo(mine.places);
    const reach = () => (60 * 40075016 * Math.cos((at.lat * Math.PI) / 180)) / (256 * 2 ** map.getZoom());
    function draw() {
      const heading = (at.heading * Math.PI) / 180;
      body.setLatLngs(hull(at.lat, at.lng, heading, ends.length_m, ends.beam_m));
      const ahead = hull(at.lat, at.lng, heading, 2 * reach(), 1)[0];
      turn.setLatLng(ahead);
    }
    let told = 0;
    const moving = () => {
      draw();
      if (Date.now() - told > 200) { told = Date.now(); emitEvent("end_moving", at); }
    };
    mark.on("drag", () => { Object.assign(at, plain(mark.getLatLng())); moving(); });
    turn.on("drag", () => {
      const ahead = turn.getLatLng();
      const east = (ahead.lng - at.lng) * Math.cos((at.lat * Math.PI) / 180), north = ahead.lat - at.lat;
      at.heading = ((Math.atan2(east, north) * 180) / Math.PI + 360) % 360;
      moving();
    });
    for (const one of [mark, turn]) one.on("dragend", () => emitEvent("end_moved", at));
    map.on("zoomend", draw);
    draw();
  }

  async function trial(id, url, place) {
    const mine = charts[id];
    for (const shown of [mine.player, mine.sketch]) if (shown) shown.remove();
    mine.player = mine.sketch = null;
    if (mine.ring) mine.ring.remove();
    if (place) {
      mine.ring = L.circleMarker([place.lat_deg, place.lon_deg], { radius: 18, color: "#c81e1e", weight: 4, fill: false, renderer: L.svg() }).addTo(mapOf(id));
      mapOf(id).panTo([place.lat_deg, place.lon_deg]);
    }
    if (!url) return;
    const answer = await (await fetch(url)).json();
    if (answer.problem) document.getElementById(`now${id}`).textContent = answer.problem;
    else if (answer.sketch) mine.sketch = sketched(id, answer.sketch);
    else mine.player = new Player(id, answer);
  }

  function wayOf(points, leg) {
    const run = leg && leg.kind === "primitive";
    const line = L.polyline(points, { color: run ? COLOURS.run : COLOURS.track, weight: run ? 4 : 2, smoothFactor: 0.3 });
    return leg ? line.bindTooltip(leg.name, { sticky: true }) : line;
  }

  function sketched(id, legs) {
    const group = L.layerGroup(legs.map((leg) => wayOf(leg.places, leg))).addTo(mapOf(id));
    mapOf(id).fitBounds(L.latLngBounds(legs.flatMap((leg) => leg.places)), { padding: [30, 30] });
    mapOf(id).getContainer().dataset.sketched = legs.length;
    return group;
  }

  class Player {
    constructor(id, plan) {
      this.id = id;
      this.plan = plan;
      this.rate = 10;
      this.time = plan.columns.time_s;
      this.until = this.time[this.time.length - 1];
      this.now = 0;
      this.playing = false;
      this.group = L.layerGroup().addTo(mapOf(id));
      const { lat_deg: lat, lon_deg: lon, leg } = plan.columns;
      let from = 0;
      for (let k = 1; k <= leg.length; k++) {
        if (k < leg.length && leg[k] === leg[from]) continue;
        const points = [];
        for (let i = from; i <= Math.min(k, leg.length - 1); i++) points.push([lat[i], lon[i]]);
        wayOf(points, plan.legs[leg[from]]).addTo(this.group);
        from = k;
      }
      this.body = L.polygon([], { color: "#111", weight: 1, fillColor: "#f5c400", fillOpacity: 0.95, interactive: false, renderer: L.svg() }).addTo(this.group);
      this.dot = L.circleMarker([lat[0], lon[0]], { radius: 6, color: "#111", weight: 2, fillColor: "#f5c400", fillOpacity: 1, interactive: false, renderer: L.svg() }).addTo(this.group);
      mapOf(id).fitBounds(L.latLngBounds(lat.map((value, k) => [value, lon[k]])), { padding: [30, 30] });
      this.slider = document.getElementById(`when${id}`);
      this.slider.max = this.until;
      this.slider.oninput = () => this.show(Number(this.slider.value));
      this.show(0);
    }
    remove() { this.playing = false; this.group.remove(); }
    speed(rate) { this.rate = rate; }
    toggle() {
      if (this.now >= this.until) this.now = 0;
      this.playing = !this.playing;
      this.last = performance.now();
      emitEvent("played", { playing: this.playing });
      if (this.playing) requestAnimationFrame((t) => this.step(t));
    }
    step(t) {
      if (!this.playing) return;
      this.show(Math.min(this.until, this.now + ((t - this.last) / 1000) * this.rate));
      this.last = t;
      if (this.now >= this.until) { this.playing = false; emitEvent("played", { playing: false }); return; }
      requestAnimationFrame((next) => this.step(next));
    }
    show(now) {
      this.now = now;
      const k = this.index(now), next = Math.min(k + 1, this.time.length - 1), of = this.plan.columns;
      const share = next > k ? (now - this.time[k]) / (this.time[next] - this.time[k]) : 0;
      const mix = (name) => of[name][k] + share * (of[name][next] - of[name][k]);
      const turned = Math.atan2(Math.sin(of.heading_rad[next] - of.heading_rad[k]), Math.cos(of.heading_rad[next] - of.heading_rad[k]));
      const heading = of.heading_rad[k] + share * turned;
      this.body.setLatLngs(hull(mix("lat_deg"), mix("lon_deg"), heading, this.plan.length_m, this.plan.beam_m));
      this.dot.setLatLng([mix("lat_deg"), mix("lon_deg")]);
      this.slider.value = now;
      const leg = this.plan.legs[of.leg[k]], degrees = (((heading * 180) / Math.PI) % 360 + 360) % 360;
      const rows = [
        ["time", clock(now)], ["leg", leg ? leg.name : ""], ["heading", `${degrees.toFixed(0).padStart(3, "0")}°`],
        ["ahead", `${fixed(mix("u_mps"), 2)} m/s`], ["to starboard", `${fixed(mix("v_mps"), 2)} m/s`],
        ["turning", `${fixed((mix("r_radps") * 180) / Math.PI, 2)} °/s`],
        ...Object.entries(this.plan.commands).map(([name, values]) => [...order(name, values[k])]),
      ];
      const table = document.createElement("dl");
      for (const [name, value] of rows) {
        const term = document.createElement("dt"), text = document.createElement("dd");
        const pair = document.createElement("div");
        term.textContent = name;
        text.textContent = value;
        if (name === "leg") pair.className = "long";
        pair.append(term, text);
        table.append(pair);
      }
      document.getElementById(`now${this.id}`).replaceChildren(table);
    }
    index(now) {
      let low = 0, high = this.time.length - 1;
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (this.time[middle] <= now) low = middle; else high = middle;
      }
      return low;
    }
  }

  const UNITS = { rps: ["1/s", 1, 2], rad: ["°", 180 / Math.PI, 1] };

  function order(name, value) {
    const cut = name.lastIndexOf("_"), [unit, factor, decimals] = UNITS[name.slice(cut + 1)] || ["", 1, 3];
    return [unit ? name.slice(0, cut) : name, `${fixed(value * factor, decimals)} ${unit}`];
  }

  // A number without the sign of zero.
  const fixed = (value, decimals) => value.toFixed(decimals).replace(/^-(?=[0.]*$)/, "");

  function clock(seconds) {
    const s = Math.floor(seconds);
    return `${Math.floor(s / 3600)}:${String(Math.floor(s / 60) % 60).padStart(2, "0")}:${String(s % 60).padStart(2, "0")}`;
  }

  const still = { toggle() {}, speed() {} };
  window.expd = { chart, pen, trial, player: (id) => (charts[id] && charts[id].player) || still };
})();
