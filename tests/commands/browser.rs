//! A browser without a window.

use image::RgbImage;
use serde_json::Value;
use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use viewfuse_tests::patience::end;

/// What people call it, in the order in which it is looked for.
const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// Chromium or Chrome.
pub(crate) struct Browser {
    program: PathBuf,
}

/// What lets tests fail that lack a browser.
pub(super) const REQUIRE: &str = "VIEWFUSE_REQUIRE_BROWSER";

/// What a page looks like.
pub(super) struct Seen {
    /// One a width, as `probe.html` tells it.
    pub(super) views: Value,
    /// What the browser's console says.
    pub(super) console: String,
}

impl Browser {
    /// What is missing, if there is none.
    pub(super) fn missing() -> Option<String> {
        Browser::find().err()
    }

    /// The one that a test needs.
    pub(super) fn needed() -> Browser {
        Browser::find().unwrap_or_else(|missing| panic!("{missing}"))
    }

    /// The one that is there, or what is missing.
    fn find() -> Result<Browser, String> {
        if let Some(program) = env::var_os("VIEWFUSE_BROWSER") {
            return Ok(Browser { program: program.into() });
        }
        let folders: Vec<PathBuf> = env::var_os("PATH").iter().flat_map(env::split_paths).collect();
        let places = NAMES.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
        let program = places.into_iter().find(|place| place.is_file()).ok_or("no Chromium: tests/run installs it")?;
        Ok(Browser { program })
    }

    /// Its program.
    pub(crate) fn program(&self) -> &Path {
        &self.program
    }

    /// Runs it to its end and returns what it printed: the page, and its messages.
    fn run(&self, arguments: &[String]) -> (String, String) {
        let profile = tempfile::tempdir().expect("a folder");
        let output = |name: &str| fs::File::create(profile.path().join(name)).expect("a file");
        // Nothing behind this address answers: whatever is asked of the network fails.
        let mut child = Command::new(&self.program)
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run"])
            .args(["--disable-component-update", "--disable-sync", "--hide-scrollbars", "--enable-logging=stderr"])
            .args(["--proxy-server=127.0.0.1:9", "--virtual-time-budget=20000"])
            .arg(format!("--user-data-dir={}", profile.path().join("profile").display()))
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(output("page"))
            .stderr(output("messages"))
            .spawn()
            .unwrap_or_else(|error| panic!("{}: {error}", self.program.display()));
        let status = end(&mut child).unwrap_or_else(|error| panic!("the browser does not come to an end: {error}"));
        let text = |name: &str| {
            let bytes = fs::read(profile.path().join(name)).expect("a file");
            String::from_utf8_lossy(&bytes).into_owned()
        };
        assert!(status.success(), "{}", text("messages"));
        (text("page"), text("messages"))
    }

    /// Looks at a page in several widths.
    pub(super) fn look(&self, page: &str) -> Seen {
        let folder = tempfile::tempdir().expect("a folder");
        let probe = folder.path().join("probe.html");
        // A closing tag would end the script that holds the page.
        let text = serde_json::to_string(page).expect("JSON").replace("</", "<\\/");
        fs::write(&probe, include_str!("browser/probe.html").replacen("= PAGE;", &format!("= {text};"), 1))
            .expect("a file");
        let (page, messages) = self.run(&["--dump-dom".to_owned(), format!("file://{}", probe.display())]);
        let seen = page.split_once("<pre id=\"seen\">").and_then(|(_, rest)| rest.split_once("</pre>"));
        let json = seen.unwrap_or_else(|| panic!("nothing is seen: {messages}")).0;
        let json = json.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
        let console: Vec<&str> = messages.lines().filter(|line| line.contains(":CONSOLE")).collect();
        Seen { views: serde_json::from_str(&json).expect("JSON"), console: console.join("\n") }
    }

    /// A picture of the top of a page, which is left in `file`.
    pub(super) fn picture(&self, page: &Path, file: &Path, width: u32, is_dark: bool) -> RgbImage {
        let mut arguments = vec![
            format!("--window-size={width},2400"),
            format!("--screenshot={}", file.display()),
            format!("file://{}", page.display()),
        ];
        if is_dark {
            arguments.insert(0, "--blink-settings=preferredColorScheme=0".to_owned());
        }
        self.run(&arguments);
        image::open(file).unwrap_or_else(|error| panic!("{}: {error}", file.display())).to_rgb8()
    }
}
