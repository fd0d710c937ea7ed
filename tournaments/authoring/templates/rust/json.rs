//! A small JSON reader: text in, a tree out; `None` if the text is no JSON.

pub enum Json {
    Null,
    Bool(bool),
    Number(f64),
    Text(String),
    List(Vec<Json>),
    Object(Vec<(String, Json)>),
}

const MOST_DEPTH: usize = 64;

impl Json {
    pub fn read(text: &str) -> Option<Json> {
        let mut reader = Reader { bytes: text.trim_end().as_bytes(), at: 0 };
        let value = reader.value(0)?;
        (reader.at == reader.bytes.len()).then_some(value)
    }

    /// The value of a key of an object; null where there is none.
    pub fn get(&self, key: &str) -> &Json {
        match self {
            Json::Object(pairs) => pairs.iter().find(|(name, _)| name == key).map_or(&Json::Null, |(_, value)| value),
            _ => &Json::Null,
        }
    }

    pub fn items(&self) -> &[Json] {
        if let Json::List(items) = self { items } else { &[] }
    }

    pub fn int(&self) -> i64 {
        if let Json::Number(number) = self { *number as i64 } else { 0 }
    }

    pub fn text(&self) -> &str {
        if let Json::Text(text) = self { text } else { "" }
    }

    pub fn is_true(&self) -> bool {
        matches!(self, Json::Bool(true))
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn peek(&mut self) -> Option<u8> {
        while self.bytes.get(self.at)?.is_ascii_whitespace() {
            self.at += 1;
        }
        Some(self.bytes[self.at])
    }

    /// Step over a character if it is the next one.
    fn skip(&mut self, wanted: u8) -> bool {
        let is_next = self.peek() == Some(wanted);
        self.at += is_next as usize;
        is_next
    }

    fn value(&mut self, depth: usize) -> Option<Json> {
        match self.peek()? {
            _ if depth > MOST_DEPTH => None,
            b'"' => self.text().map(Json::Text),
            b'[' => {
                self.at += 1;
                let mut items = Vec::new();
                while !self.skip(b']') {
                    if !items.is_empty() && !self.skip(b',') {
                        return None;
                    }
                    items.push(self.value(depth + 1)?);
                }
                Some(Json::List(items))
            }
            b'{' => {
                self.at += 1;
                let mut pairs = Vec::new();
                while !self.skip(b'}') {
                    if !pairs.is_empty() && !self.skip(b',') || self.peek() != Some(b'"') {
                        return None;
                    }
                    let key = self.text()?;
                    if !self.skip(b':') {
                        return None;
                    }
                    pairs.push((key, self.value(depth + 1)?));
                }
                Some(Json::Object(pairs))
            }
            _ => {
                let begin = self.at;
                while self.at < self.bytes.len() && !b",:]} \t\r\n".contains(&self.bytes[self.at]) {
                    self.at += 1;
                }
                match std::str::from_utf8(&self.bytes[begin..self.at]).ok()? {
                    "null" => Some(Json::Null),
                    "true" => Some(Json::Bool(true)),
                    "false" => Some(Json::Bool(false)),
                    number => number.parse().ok().map(Json::Number),
                }
            }
        }
    }

    /// A text between quotes; escapes other than those of one character stay as they are written.
    fn text(&mut self) -> Option<String> {
        let mut bytes = Vec::new();
        self.at += 1;
        loop {
            let byte = *self.bytes.get(self.at)?;
            self.at += 1;
            match byte {
                b'"' => return String::from_utf8(bytes).ok(),
                b'\\' => {
                    let escaped = *self.bytes.get(self.at)?;
                    self.at += 1;
                    match escaped {
                        b'n' => bytes.push(b'\n'),
                        b't' => bytes.push(b'\t'),
                        b'"' | b'\\' | b'/' => bytes.push(escaped),
                        other => bytes.extend([b'\\', other]),
                    }
                }
                other => bytes.push(other),
            }
        }
    }
}
