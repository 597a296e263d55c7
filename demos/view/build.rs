//! Bundles the three-dimensional part of the page with esbuild, if its packages are installed.
//!
//! `npm ci` in `web/` installs them (`make setup` does it). Without them the page is built without 3D and says so. Nothing is downloaded here.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// Command of the bundler, relative to `web/`.
const BUNDLER: &str = "node_modules/.bin/esbuild";

fn main() {
    println!("cargo:rustc-check-cfg=cfg(scene_bundled)");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR")).join("scene.js");
    bundle(&out);
}

/// Writes the bundle to `out`, or nothing.
fn bundle(out: &Path) {
    let web = Path::new("web");
    // A file that is missing would let cargo run this at each build, a folder with many files makes it slow.
    let installed = web.join("node_modules/.package-lock.json");
    if !installed.exists() {
        println!("cargo:rerun-if-changed=web");
        write_fallback(out, "the packages of demos/view/web are not installed");
        return;
    }
    println!("cargo:rerun-if-changed=web/scene");
    println!("cargo:rerun-if-changed={}", installed.display());
    let bundled = Command::new(web.join(BUNDLER))
        .args(["web/scene/scene.js", "--bundle", "--minify", "--format=esm"])
        .args([
            "--target=es2022",
            "--log-level=warning",
            "--legal-comments=none",
        ])
        .arg(format!("--outfile={}", out.display()))
        .status();
    match bundled {
        Ok(status) if status.success() => println!("cargo:rustc-cfg=scene_bundled"),
        Ok(status) => write_fallback(out, &format!("esbuild failed: {status}")),
        Err(error) => write_fallback(out, &format!("cannot run esbuild: {error}")),
    }
}

fn write_fallback(out: &Path, reason: &str) {
    // Without packages this is the usual plain build, about which nobody needs a warning.
    if !reason.contains("not installed") {
        println!("cargo:warning=the live view is built without 3D: {reason}");
    }
    fs::write(out, "").expect("OUT_DIR can be written");
}
