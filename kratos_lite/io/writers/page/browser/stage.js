// The stage: camera, light, the body's triangles and lines, drawn when something has changed.

// Colors of low to high values, as in matplotlib's viridis (CC0).
const RAMP = [
  "#440154", "#482475", "#414487", "#355f8d", "#2a788e", "#21918c",
  "#22a884", "#44bf70", "#7ad151", "#bddf26", "#fde725",
];

class Stage {
  constructor(target, radius) {
    this.target = target;
    this.radius = radius;
    this.renderer = new THREE.WebGLRenderer({ alpha: true, antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(window.devicePixelRatio);
    this.renderer.localClippingEnabled = true;
    target.prepend(this.renderer.domElement);
    this.plane = new THREE.Plane();
    this.scene = new THREE.Scene();
    this.camera = new THREE.OrthographicCamera(-1, 1, 1, -1, -100 * radius, 100 * radius);
    this.camera.add(new THREE.DirectionalLight(0xffffff, 0.32));
    this.camera.children[0].position.set(-0.4, 0.5, 1);
    this.scene.add(this.camera, new THREE.AmbientLight(0xffffff, 0.72));
    this.controls = new THREE.TrackballControls(this.camera, this.renderer.domElement);
    Object.assign(this.controls, { staticMoving: true, rotateSpeed: 2.5, keys: [] });
    this.controls.addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.resize()).observe(target);
    this.resize();
    this.look([1, -1, 1]);
    const turn = () => {
      this.controls.update();
      requestAnimationFrame(turn);
    };
    turn();
  }

  // Nothing lies under the legend: the body is in the middle of what it leaves free.
  resize() {
    const { clientWidth: width, clientHeight: height } = this.target;
    if (!width || !height) return;
    this.renderer.setSize(width, height);
    const legend = $("legend").offsetLeft + $("legend").offsetWidth;
    const top = 1.05 * this.radius / Math.min(1, (width - legend) / height), right = top * width / height;
    Object.assign(this.camera, { left: -right, right, top, bottom: -top });
    this.camera.setViewOffset(width, height, -legend / 2, 0, width, height);
    this.controls.handleResize();
    this.draw();
  }

  look(direction) {
    this.controls.target.set(0, 0, 0);
    this.camera.position.set(...direction).setLength(10 * this.radius);
    this.camera.up.set(0, direction[0] || direction[1] ? 0 : 1, direction[0] || direction[1] ? 1 : 0);
    this.camera.zoom = 1;
    this.camera.lookAt(0, 0, 0);
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  // Draw once before the next picture of the screen, however often it is asked for.
  draw() {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = 0;
      this.renderer.render(this.scene, this.camera);
      this.onDrawn?.();
    });
  }

  // Return origin and direction of the ray through a place of the window.
  ray(x, y) {
    const box = this.renderer.domElement.getBoundingClientRect();
    const place = [2 * (x - box.left) / box.width - 1, 1 - 2 * (y - box.top) / box.height];
    const [near, far] = [-1, 1].map((z) => new THREE.Vector3(...place, z).unproject(this.camera));
    return [near.toArray(), far.sub(near).normalize().toArray()];
  }

  triangles(clipped) {
    this.ramp ??= rampTexture();
    const material = new THREE.MeshPhongMaterial({
      map: this.ramp, side: THREE.DoubleSide, flatShading: true, specular: 0, polygonOffset: true,
      polygonOffsetFactor: 1, polygonOffsetUnits: 1, clippingPlanes: clipped ? [this.plane] : [],
    });
    return this.add(new THREE.Mesh(new THREE.BufferGeometry(), material));
  }

  lines(color, opacity, clipped) {
    const material = new THREE.LineBasicMaterial({
      color, opacity, transparent: opacity < 1, clippingPlanes: clipped ? [this.plane] : [],
    });
    return this.add(new THREE.LineSegments(new THREE.BufferGeometry(), material));
  }

  mark(color, size) {
    const material = new THREE.PointsMaterial({ color, size, sizeAttenuation: false, depthTest: false });
    const points = this.add(new THREE.Points(new THREE.BufferGeometry(), material));
    points.visible = false;
    return points;
  }

  // Give triangles or lines their points, new ones in place of those they had.
  reshape(thing, positions, corners = null) {
    thing.geometry.dispose();
    thing.geometry = new THREE.BufferGeometry();
    thing.geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    const places = new Float32Array(positions.length / 3 * 2);
    if (thing.isMesh) thing.geometry.setAttribute("uv", new THREE.BufferAttribute(places, 2));
    if (corners) thing.geometry.setIndex(new THREE.BufferAttribute(corners, 1));
  }

  add(thing) {
    thing.frustumCulled = false;  // positions change, and bounds with them
    this.scene.add(thing);
    return thing;
  }
}

function rampTexture() {
  const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
  [canvas.width, canvas.height] = [512, 1];
  const gradient = pen.createLinearGradient(0, 0, 512, 0);
  RAMP.forEach((color, i) => gradient.addColorStop(i / (RAMP.length - 1), color));
  pen.fillStyle = gradient;
  pen.fillRect(0, 0, 512, 1);
  const texture = new THREE.CanvasTexture(canvas);
  texture.minFilter = texture.magFilter = THREE.LinearFilter;
  texture.generateMipmaps = false;
  return texture;
}

function colored(mesh, values, [low, high]) {
  const uv = mesh.geometry.attributes.uv;
  for (let i = 0; i < values.length; i++)
    uv.array[2 * i] = Math.min(1, Math.max(0, (values[i] - low) / (high - low)));
  uv.needsUpdate = true;
}
