//! `diagnose --report`: a page with the numbers of the findings that loads nothing and that a browser draws.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use hyst_ident::diagnose::{MOST_POINTS, Picture};
use hyst_tests::Lab;
use serde_json::{Value, json};

/// Returns a lab in which a lag has been diagnosed, with `findings.json` and `report.html`.
fn diagnosed() -> Lab {
    let lab = Lab::with_model();
    lab.excite_for_test("u2.csv");
    lab.ok("run --daq sim:plant.toml --drive u2.csv --record test.csv");
    // An existing file is replaced, as with every output.
    lab.write("report.html", "old");
    let ran =
        lab.ok("diagnose train.csv --test test.csv --model model.json --findings findings.json --report report.html");
    assert!(ran.stdout.contains("report: report.html"), "{}", ran.stdout);
    lab
}

/// Formats `x` as reports do.
fn short(x: f64) -> String {
    let decimals = (3 - x.abs().log10().floor() as i32).max(0) as usize;
    format!("{x:.decimals$}")
}

/// Returns the JSON of the plots in the page.
fn plotted(page: &str) -> &str {
    let (_, rest) = page.split_once("<script type=\"application/json\" id=\"pictures\">").expect("the plots' numbers");
    rest.split_once("</script>").expect("their end").0
}

#[test]
fn a_page_agrees_with_the_findings_and_loads_nothing() {
    let lab = diagnosed();
    assert_agrees_with_findings(&lab);
    assert_loads_nothing(&lab.read("report.html"));

    // The same bytes on stdout.
    let piped = lab.ok("diagnose train.csv --test test.csv --model model.json --report -");
    assert!(piped.stdout == lab.read("report.html"));
    assert!(piped.stderr.contains("explained in part by lag"), "{}", piped.stderr);
    let message = lab.fails("diagnose train.csv --model model.json --report model.json", 2);
    assert!(message.contains("the same command reads this file"), "{message}");
}

fn assert_agrees_with_findings(lab: &Lab) {
    let (page, findings) = (lab.read("report.html"), lab.read("findings.json"));
    let findings: Value = serde_json::from_str(&findings).unwrap();
    let has = |part: &str| assert!(page.contains(part), "{part:?} is missing");
    // A sentence without its first letter, with apostrophes as in HTML.
    let has_sentence = |sentence: &Value| has(&sentence.as_str().unwrap()[1..].replace('\'', "&#39;"));
    has("<html lang=\"en\">");
    has("<title>Diagnosis of model.json on train.csv</title>");
    has("Explained in part by lag.");
    for when in ["before", "after"] {
        for record in ["train", "test"] {
            for figure in ["rmse", "max_abs"] {
                has(&format!(">{}</td>", short(findings[when][record][figure].as_f64().unwrap())));
            }
        }
    }
    let lag = &findings["effects"][0];
    assert_eq!(lag["name"], "lag");
    has("<h3 class=\"effect\">lag</h3>");
    // Value and standard error with the digits for a reader.
    let seconds = &lag["parameters"]["seconds"];
    let (value, error) = (seconds["value"].as_f64().unwrap(), seconds["std_error"].as_f64().unwrap());
    let decimals = (1.0 - error.log10().floor()) as usize;
    has(&format!("{value:.decimals$} ± {error:.decimals$} s"));
    lag["evidence"].as_array().unwrap().iter().for_each(has_sentence);
    let alternatives = lag["alternatives"].as_array().unwrap();
    assert!(!alternatives.is_empty());
    for other in alternatives {
        has(&format!("{}</td>", short(other["cv_rmse"].as_f64().unwrap())));
    }
    let remainder = &findings["remainder"];
    has_sentence(&remainder["description"]);
    remainder["where"].as_array().into_iter().flatten().for_each(has_sentence);
    let model: Value = serde_json::from_str(&lab.read("model.json")).unwrap();
    has(model["fitted_on"][0]["sha256"].as_str().unwrap());
    has("load_n");
    has("hystctl fit train.csv --model preisach");

    // Tables have headings with a scope.
    assert_eq!(page.matches("<table>").count(), page.matches("<thead>").count());
    assert!(page.matches("scope=\"col\"").count() > 10 && page.matches("scope=\"row\"").count() > 10);

    let pictures: Vec<Picture> = serde_json::from_str(plotted(&page)).unwrap();
    assert_eq!(page.matches("<figure ").count(), pictures.len());
    let about = |effect: &str| pictures.iter().filter(|p| p.effect.is_some_and(|e| e.name() == effect)).count();
    assert!(about("lag") >= 2 && pictures.iter().all(|p| p.effect.is_none_or(|e| e.name() == "lag")));
    assert!(pictures.iter().flat_map(|p| &p.curves).all(|c| c.x.len() <= MOST_POINTS && c.x.len() == c.y.len()));
}

fn assert_loads_nothing(page: &str) {
    assert!(page.contains("Content-Security-Policy\" content=\"default-src 'none'"));
    for loading in [
        "http://",
        "https://",
        "//cdn",
        "src=",
        "@import",
        "url(",
        "fetch(",
        "XMLHttpRequest",
        "import(",
        "WebSocket",
        "sendBeacon",
    ] {
        assert!(!page.contains(loading), "{loading}");
    }
    let links: Vec<&str> = page.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    assert!(links.iter().all(|link| link.starts_with('#') || *link == "data:,"), "{links:?}");
}

/// Returns the path of a Chromium.
fn browser() -> PathBuf {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let folders: Vec<PathBuf> = env::split_paths(&env::var_os("PATH").unwrap_or_default()).collect();
    let mut files = names.iter().flat_map(|name| folders.iter().map(move |f| f.join(name)));
    files.find(|file| file.is_file()).expect("a Chromium is installed")
}

/// Opens a page in a browser without a window. Returns its stdout.
fn browse(browser: &Path, profile: &Path, page: &Path, width: u32, arguments: &[String]) -> String {
    let output = Command::new(browser)
        .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--enable-logging=stderr"])
        .args(["--disable-background-networking", "--no-first-run", "--virtual-time-budget=20000"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("--window-size={width},1600"))
        .args(arguments)
        .arg(format!("file://{}", page.display()))
        .output()
        .expect("the browser starts");
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{log}");
    let console: Vec<&str> = log.lines().filter(|line| line.contains("CONSOLE")).collect();
    assert!(console.is_empty(), "the browser's console: {console:?}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// First script of the page: collects errors and warnings. The browser's virtual time has no animation frames, so timers
/// replace them.
const LISTEN: &str = "<script>window.problems = [];\
    window.addEventListener('error', (e) => problems.push(e.message));\
    window.addEventListener('unhandledrejection', (e) => problems.push(String(e.reason)));\
    for (const kind of ['error', 'warn']) console[kind] = (...words) => problems.push(words.join(' '));\
    window.requestAnimationFrame = (draw) => setTimeout(draw, 10);\
    window.cancelAnimationFrame = clearTimeout;</script>";

/// Last script of the page: uses every plot and sends what it saw.
const CHECK: &str = include_str!("report/check.js");
/// What the script counts: in how many plots it worked.
const COUNTED: [&str; 13] = [
    "drawn", "zoomed", "whole", "clicked", "pinched", "moved", "reset", "keys", "hidden", "read", "printed", "kept",
    "resized",
];

/// A screen: width in pixels, device pixels per pixel, colour scheme, and what the page looks like on it.
struct Screen {
    width: u32,
    ratio: u32,
    is_dark: bool,
    columns: u32,
    background: &'static str,
}

const SCREENS: [Screen; 2] = [
    Screen { width: 1200, ratio: 1, is_dark: false, columns: 2, background: "rgb(255, 255, 255)" },
    Screen { width: 390, ratio: 2, is_dark: true, columns: 1, background: "rgb(20, 24, 29)" },
];

impl Screen {
    /// Arguments of the browser.
    fn arguments(&self) -> Vec<String> {
        let scheme = u8::from(!self.is_dark);
        vec![
            format!("--blink-settings=preferredColorScheme={scheme}"),
            format!("--force-device-scale-factor={}", self.ratio),
        ]
    }
}

#[test]
#[cfg_attr(not(browser), ignore = "no Chromium is installed (Debian: apt-get install chromium)")]
fn a_browser_draws_every_plot_without_errors() {
    let browser = browser();
    let lab = diagnosed();
    let page = lab.read("report.html");
    let figures = page.matches("<figure ").count() as u64;
    // The same page with the two test scripts.
    let head = page.find("<meta charset").expect("a head");
    let check = format!("<script>{CHECK}</script></body>");
    let checked = format!("{}{LISTEN}{}", &page[..head], &page[head..]).replace("</body>", &check);
    lab.write("checked.html", checked);
    let profile = lab.path("profile");
    for screen in &SCREENS {
        let width = screen.width;
        // A window has a minimum width, a frame has not.
        lab.write(
            "frame.html",
            format!(
                "<!DOCTYPE html><iframe src=\"checked.html\" style=\"width: {width}px; height: 1600px; border: 0\"></iframe><script>\
                addEventListener('message', (e) => document.documentElement.setAttribute('data-seen', e.data));</script>"
            ),
        );
        let dump = [screen.arguments(), vec!["--dump-dom".into()]].concat();
        let dom = browse(&browser, &profile, &lab.path("frame.html"), 1300, &dump);
        let seen = dom
            .split_once("data-seen=\"")
            .and_then(|(_, rest)| rest.split_once('"'))
            .expect("the results of the page")
            .0;
        let seen: Value = serde_json::from_str(&seen.replace("&quot;", "\"").replace("&amp;", "&")).unwrap();
        let expect = |what: &str, expected: Value| assert_eq!(seen[what], expected, "{what} at {width} px: {seen}");
        for nothing in ["problems", "cut", "ticks"] {
            expect(nothing, json!([]));
        }
        for what in COUNTED {
            expect(what, json!(figures));
        }
        expect("width", json!(width));
        assert!(seen["across"].as_u64().unwrap() <= u64::from(width), "the page is wider than the screen: {seen}");
        expect("columns", json!(screen.columns));
        expect("ratios", json!([screen.ratio]));
        expect("background", json!(screen.background));
        expect("thinned", json!(true));
        expect("paper", json!([320, "rgb(255, 255, 255)", figures]));
        expect("back", json!(true));

        let shot = lab.path(&format!("{width}.png"));
        let screenshot = [screen.arguments(), vec![format!("--screenshot={}", shot.display())]].concat();
        browse(&browser, &profile, &lab.path("report.html"), width, &screenshot);
        let png = fs::read(&shot).unwrap();
        assert_eq!(&png[12..16], b"IHDR");
        assert_eq!(u32::from_be_bytes([png[16], png[17], png[18], png[19]]), width * screen.ratio);
        assert!(png.len() > 30_000, "{} bytes: the page is nearly empty", png.len());
    }
    let print = format!("--print-to-pdf={}", lab.path("report.pdf").display());
    browse(&browser, &profile, &lab.path("report.html"), 1200, &[print]);
    let pdf = fs::read(lab.path("report.pdf")).unwrap();
    assert!(pdf.starts_with(b"%PDF"));
    let pages = pdf.windows(12).filter(|w| w == b"/Type /Page\n").count();
    assert!((2..=10).contains(&pages), "{pages} pages");
}
