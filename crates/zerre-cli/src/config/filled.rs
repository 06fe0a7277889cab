//! A commented configuration with other values.

use serde_json::Value;

/// The TOML text with the values of `values` in the place of its own. A table of an array stands once in the
/// text and as often in what is made of it as there are values; what `values` has not, or has as null, stays
/// as it is.
pub fn filled(text: &str, values: &Value) -> String {
    let mut made = String::new();
    let mut at = Some(values);
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        let within = |inner: &str| inner.split('.').try_fold(values, |value, key| value.get(key.trim()));
        if let Some(path) = line.strip_prefix("[[").and_then(|rest| rest.strip_suffix("]]")) {
            let mut block = Vec::new();
            while let Some(line) = lines.next_if(|line| line.contains('=') && !line.starts_with('#')) {
                block.push(line);
            }
            let all = within(path).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
            for (k, value) in all.iter().enumerate() {
                let gap = if k > 0 { "\n" } else { "" };
                made += &format!("{gap}{line}\n");
                block.iter().for_each(|line| made += &set(line, Some(value)));
            }
            at = None;
        } else if let Some(path) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            at = within(path);
            made += &format!("{line}\n");
        } else {
            made += &set(line, at);
        }
    }
    made
}

/// The line `key = value` with the table's value of that key.
fn set(line: &str, table: Option<&Value>) -> String {
    let key = line.split_once('=').map(|(key, _)| key.trim()).filter(|key| !key.starts_with('#'));
    let value = key.and_then(|key| table?.get(key)).filter(|value| !value.is_null());
    match (key, value) {
        (Some(key), Some(Value::Array(values))) => {
            let values: Vec<String> = values.iter().map(Value::to_string).collect();
            format!("{key} = [{}]\n", values.join(", "))
        }
        // Numbers, strings and booleans are written alike in both languages.
        (Some(key), Some(value)) => format!("{key} = {value}\n"),
        _ => format!("{line}\n"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn values_take_their_places_and_remarks_stay() {
        let text = "# a = 1\na = 1\nb = 2 # gone\n\n[c]\nd = [1, 2]\n\n# Each.\n[[c.e]]\nf = \"x\"\n\n[g]\nh = true\n";
        let values = json!({"a": 3, "c": {"d": [0.5, 1e-9], "e": [{"f": "y"}, {"f": "z\"\n"}]}, "g": null});
        let made = "# a = 1\na = 3\nb = 2 # gone\n\n[c]\nd = [0.5, 1e-9]\n\n# Each.\n[[c.e]]\nf = \"y\"\n\n[[c.e]]\nf = \
                    \"z\\\"\\n\"\n\n[g]\nh = true\n";
        assert_eq!(filled(text, &values), made);
        let table: toml::Value = toml::from_str(made).unwrap();
        assert_eq!(table["c"]["e"][1]["f"].as_str(), Some("z\"\n"));
    }
}
