//! Pages of HTML that are whole in themselves: no scripts, nothing to be fetched but pictures beside them.

/// A page. `title` is plain text; `css` and `body` are taken as they are.
pub(crate) fn page(title: &str, css: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{}</title>\n<style>\n{}\n</style>\n</head>\n<body>\n{body}</body>\n</html>\n",
        escape(title),
        css.trim_end(),
    )
}

/// A PNG file as the address of an image, so that a page holds it.
pub(crate) fn png_address(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", base64(png))
}

/// RFC 4648, section 4.
pub(crate) fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let bits = (0..3).fold(0_u32, |bits, n| bits << 8 | u32::from(three.get(n).copied().unwrap_or(0)));
        for n in 0..4 {
            let digit = char::from(DIGITS[(bits >> (18 - 6 * n)) as usize & 63]);
            out.push(if n <= three.len() { digit } else { '=' });
        }
    }
    out
}

/// Text for element content and quoted attributes.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // What HTML does not allow at all.
            c if c.is_control() && !c.is_ascii_whitespace() => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_text() {
        assert_eq!(
            escape("<b>\"A\" & 'B'</b>\n\u{1b}"),
            "&lt;b&gt;&quot;A&quot; &amp; &#39;B&#39;&lt;/b&gt;\n\u{fffd}"
        );
    }

    #[test]
    fn images_are_base64() {
        for (png, text) in [(&b""[..], ""), (b"f", "Zg=="), (b"fo", "Zm8="), (b"foo", "Zm9v"), (b"foobar", "Zm9vYmFy")]
        {
            assert_eq!(png_address(png), format!("data:image/png;base64,{text}"));
        }
    }

    #[test]
    fn a_page_holds_what_it_is_given() {
        let page = page("a < b", "p{color:red}\n", "<p>text</p>\n");
        assert!(page.starts_with("<!DOCTYPE html>\n<html lang=\"en\">\n<head>"));
        assert!(
            page.contains("<title>a &lt; b</title>\n<style>\np{color:red}\n</style>\n</head>\n<body>\n<p>text</p>\n")
        );
        assert!(page.ends_with("</p>\n</body>\n</html>\n"));
    }
}
