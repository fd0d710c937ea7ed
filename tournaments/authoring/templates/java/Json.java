import java.util.ArrayList;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;

/** A small JSON reader: objects are Maps, lists are Lists, numbers are Doubles. What is no JSON is an IllegalArgumentException. */
final class Json {
    private static final int MOST_DEPTH = 64;
    private final String text;
    private int at;

    private Json(String text) {
        this.text = text;
    }

    static Object read(String text) {
        Json json = new Json(text);
        Object value = json.value(0);
        if (json.peek() != 0) throw json.error();
        return value;
    }

    /** The value of a key of an object; null where there is none. */
    static Object get(Object object, String key) {
        return object instanceof Map<?, ?> map ? map.get(key) : null;
    }

    static List<?> items(Object value) {
        return value instanceof List<?> list ? list : List.of();
    }

    static int number(Object value) {
        return value instanceof Double number ? number.intValue() : 0;
    }

    private Object value(int depth) {
        if (depth > MOST_DEPTH) throw error();
        char next = peek();
        if (next == '"') return string();
        if (next == '[') {
            List<Object> items = new ArrayList<>();
            for (at++; peek() != ']'; ) {
                if (!items.isEmpty()) expect(',');
                items.add(value(depth + 1));
            }
            at++;
            return items;
        }
        if (next == '{') {
            Map<String, Object> object = new LinkedHashMap<>();
            for (at++; peek() != '}'; ) {
                if (!object.isEmpty()) expect(',');
                if (peek() != '"') throw error();
                String key = string();
                expect(':');
                object.put(key, value(depth + 1));
            }
            at++;
            return object;
        }
        int begin = at;
        while (at < text.length() && ",:]} \t\r\n".indexOf(text.charAt(at)) < 0) at++;
        String word = text.substring(begin, at);
        return switch (word) {
            case "null" -> null;
            case "true" -> true;
            case "false" -> false;
            default -> Double.valueOf(word); // its NumberFormatException is an IllegalArgumentException
        };
    }

    private String string() {
        StringBuilder letters = new StringBuilder();
        for (at++; ; at++) {
            char letter = letter();
            if (letter == '"') break;
            if (letter == '\\') {
                at++;
                switch (letter()) {
                    case 'n' -> letters.append('\n');
                    case 't' -> letters.append('\t');
                    case 'u' -> {
                        if (at + 4 >= text.length()) throw error();
                        letters.append((char) Integer.parseInt(text.substring(at + 1, at + 5), 16));
                        at += 4;
                    }
                    default -> letters.append(letter());
                }
            } else {
                letters.append(letter);
            }
        }
        at++;
        return letters.toString();
    }

    private char letter() {
        if (at >= text.length()) throw error();
        return text.charAt(at);
    }

    /** The next character that is no space; 0 at the end. */
    private char peek() {
        while (at < text.length() && " \t\r\n".indexOf(text.charAt(at)) >= 0) at++;
        return at < text.length() ? text.charAt(at) : 0;
    }

    private void expect(char wanted) {
        if (peek() != wanted) throw error();
        at++;
    }

    private IllegalArgumentException error() {
        return new IllegalArgumentException("not JSON at character " + at);
    }
}
