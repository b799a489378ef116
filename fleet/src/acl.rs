//! Who may do what on the hub's network: a robot writes and answers below its own key, and nothing else.
//!
//! Without a rule nothing passes. `acl.example.json5` is the same for two robots, for a router that is not this program's.

use crate::name::{Name, below};
use serde_json::{Value, json};

/// Zenoh's `access_control` for these robots; each is who its password says.
#[must_use]
pub fn access_control<'a>(site: &Name, robots: impl IntoIterator<Item = &'a Name>) -> Value {
    let (mut rules, mut subjects, mut policies) = (Vec::new(), Vec::new(), Vec::new());
    for robot in robots {
        let [writes, is_asked] = [format!("{robot} writes"), format!("{robot} is asked")];
        rules.push(json!({
            "id": writes,
            "permission": "allow",
            "flows": ["ingress"],
            "messages": ["put", "declare_queryable", "reply", "liveliness_token"],
            "key_exprs": [below(site, robot)],
        }));
        rules.push(json!({
            "id": is_asked,
            "permission": "allow",
            "flows": ["egress"],
            "messages": ["query", "declare_subscriber", "liveliness_query", "declare_liveliness_subscriber"],
            "key_exprs": [below(site, robot)],
        }));
        subjects.push(json!({ "id": robot, "usernames": [robot] }));
        policies.push(json!({ "rules": [writes, is_asked], "subjects": [robot] }));
    }
    json!({ "enabled": true, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_says_the_same() {
        let example: Value = json5::from_str(include_str!("../acl.example.json5")).unwrap();
        let [site, hall, kitchen] = ["home", "hall", "kitchen"].map(|name| name.parse().unwrap());
        assert_eq!(example["access_control"], access_control(&site, [&hall, &kitchen]));
    }
}
