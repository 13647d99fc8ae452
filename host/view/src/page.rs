//! The page's files, which are part of the program.

/// A file that the page consists of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PageFile {
    /// Its address below the token; empty for the page itself.
    pub(crate) name: &'static str,
    /// Its media type.
    pub(crate) media_type: &'static str,
    /// Its content.
    pub(crate) text: &'static str,
}

/// All of them.
pub(crate) const FILES: [PageFile; 3] = [
    PageFile { name: "", media_type: "text/html; charset=utf-8", text: include_str!("../page/index.html") },
    PageFile { name: "view.css", media_type: "text/css; charset=utf-8", text: include_str!("../page/view.css") },
    PageFile { name: "view.js", media_type: "text/javascript; charset=utf-8", text: include_str!("../page/view.js") },
];

#[cfg(test)]
mod tests {
    use super::FILES;

    #[test]
    fn the_page_refers_to_its_own_files_only() {
        let html = FILES[0].text;
        for attribute in ["src=\"", "href=\""] {
            for rest in html.split(attribute).skip(1) {
                let target = rest.split('"').next().unwrap_or_default();
                assert!(target == "data:," || FILES[1..].iter().any(|file| file.name == target), "{target}");
            }
        }
        assert!(!html.contains("style=\"") && !html.contains(" onclick"), "the content security policy forbids both");
        assert!(FILES.iter().all(|file| !file.text.contains("https://")), "an address outside");
    }
}
