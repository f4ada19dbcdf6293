import com.fasterxml.jackson.databind.JsonNode;
import com.fasterxml.jackson.databind.ObjectMapper;
import com.fasterxml.jackson.databind.node.ArrayNode;
import com.fasterxml.jackson.databind.node.ObjectNode;
import java.io.BufferedReader;
import java.io.InputStreamReader;
import java.math.BigInteger;
import java.nio.charset.StandardCharsets;
import java.util.ArrayList;
import java.util.Date;
import java.util.HexFormat;
import java.util.List;
import java.util.Locale;
import org.eclipse.tahu.message.model.DataSet;
import org.eclipse.tahu.message.model.DataSetDataType;
import org.eclipse.tahu.message.model.File;
import org.eclipse.tahu.message.model.Metric;
import org.eclipse.tahu.message.model.Metric.MetricBuilder;
import org.eclipse.tahu.message.model.MetricDataType;
import org.eclipse.tahu.message.model.PropertyDataType;
import org.eclipse.tahu.message.model.PropertySet;
import org.eclipse.tahu.message.model.PropertyValue;
import org.eclipse.tahu.message.model.Row;
import org.eclipse.tahu.message.model.Template;
import org.eclipse.tahu.message.model.Value;

/**
 * An edge node or a host application built with Tahu: `Peer edge HOST PORT GROUP NODE PRIMARY_HOST` or `Peer host HOST PORT GROUP
 * HOST_ID`. The language on stdin and stdout is that of tests/peers/process.py; here are its metrics.
 */
public final class Peer {

    private static final ObjectMapper JSON = new ObjectMapper();

    private Peer() {}

    /** What a role does with a line. */
    interface Role {
        /** Return false where the line ends the program. */
        boolean told(JsonNode line) throws Exception;
    }

    public static void main(final String[] arguments) throws Exception {
        final BufferedReader lines = new BufferedReader(new InputStreamReader(System.in, StandardCharsets.UTF_8));
        final String url = "tcp://" + arguments[1] + ":" + arguments[2];
        final Role role = arguments[0].equals("edge")
                ? new Edge(url, arguments[3], arguments[4], arguments.length > 5 ? arguments[5] : "", JSON.readTree(lines.readLine()))
                : new Host(url, arguments[3], arguments[4]);
        say("started", null, null);
        for (String line = lines.readLine(); line != null; line = lines.readLine()) {
            if (!role.told(JSON.readTree(line))) {
                break;
            }
        }
        System.exit(0);
    }

    /** Write one line. */
    static synchronized void say(final String event, final String device, final List<Metric> metrics) {
        final ObjectNode line = JSON.createObjectNode().put("event", event).put("device", device);
        if (metrics != null) {
            final ArrayNode told = line.putArray("metrics");
            metrics.forEach(metric -> told.add(told(metric)));
        }
        final byte[] bytes = (line + "\n").getBytes(StandardCharsets.UTF_8);
        System.out.write(bytes, 0, bytes.length);
        System.out.flush();
    }

    private static ObjectNode told(final Metric metric) {
        final ObjectNode line = JSON.createObjectNode();
        line.put("name", metric.getName()).put("type", metric.getDataType() == null ? null : metric.getDataType().toString());
        if (metric.getAlias() != null) {
            line.put("alias", metric.getAlias());
        }
        if (metric.getProperties() != null && metric.getProperties().getPropertyValue("engUnit") != null) {
            line.put("unit", String.valueOf(metric.getProperties().getPropertyValue("engUnit").getValue()));
        }
        final Object value = metric.getValue();
        if (value instanceof DataSet table) {
            final ObjectNode told = line.putObject("value");
            final ArrayNode columns = told.putArray("columns");
            table.getColumnNames().forEach(columns::add);
            final ArrayNode rows = told.putArray("rows");
            for (final Row row : table.getRows()) {
                final ArrayNode cells = rows.addArray();
                row.getValues().forEach(cell -> cells.add(text(cell.getValue())));
            }
        } else if (value instanceof Template template) {
            final ObjectNode told = line.putObject("value");
            told.put("definition", template.isDefinition()).put("ref", template.getTemplateRef());
            final ArrayNode members = told.putArray("metrics");
            template.getMetrics().forEach(member -> members.add(told(member)));
        } else {
            line.put("value", text(value));
        }
        return line;
    }

    private static String text(final Object value) {
        if (value instanceof Date date) {
            return String.valueOf(date.getTime());
        }
        if (value instanceof byte[] bytes) {
            return HexFormat.of().formatHex(bytes);
        }
        return value == null ? null : value.toString();
    }

    /** The metrics of a line. */
    static List<Metric> metrics(final JsonNode lines) throws Exception {
        final List<Metric> found = new ArrayList<>();
        for (final JsonNode line : lines) {
            found.add(metric(line));
        }
        return found;
    }

    /** One metric. Its alias is Tahu's to give. */
    static Metric metric(final JsonNode line) throws Exception {
        final MetricDataType type = type(line.get("type").asText());
        final MetricBuilder builder =
                new MetricBuilder(line.get("name").asText(), type, value(type, line.get("value"))).timestamp(new Date());
        if (line.hasNonNull("unit")) {
            final PropertySet properties = new PropertySet();
            properties.setProperty("engUnit", new PropertyValue<>(PropertyDataType.String, line.get("unit").asText()));
            builder.properties(properties);
        }
        return builder.createMetric();
    }

    private static MetricDataType type(final String name) throws Exception {
        return (MetricDataType) MetricDataType.class.getField(name).get(null);
    }

    private static Object value(final MetricDataType type, final JsonNode value) throws Exception {
        if (value == null || value.isNull()) {
            return null;
        }
        final String text = value.asText();
        return switch (type.toString().toLowerCase(Locale.ROOT)) {
            case "int8" -> Byte.valueOf(text);
            case "int16", "uint8" -> Short.valueOf(text);
            case "int32", "uint16" -> Integer.valueOf(text);
            case "int64", "uint32" -> Long.valueOf(text);
            case "uint64" -> new BigInteger(text);
            case "float" -> Float.valueOf(text);
            case "double" -> Double.valueOf(text);
            case "boolean" -> Boolean.valueOf(text);
            case "datetime" -> new Date(Long.parseLong(text));
            case "bytes" -> HexFormat.of().parseHex(text);
            case "file" -> new File("file", HexFormat.of().parseHex(text));
            case "dataset" -> table(value);
            case "template" -> template(value);
            default -> text;
        };
    }

    private static DataSet table(final JsonNode value) throws Exception {
        final DataSet.DataSetBuilder builder = new DataSet.DataSetBuilder(value.get("columns").size());
        final List<String> types = new ArrayList<>();
        value.get("columns").forEach(column -> builder.addColumnName(column.asText()));
        value.get("types").forEach(type -> types.add(type.asText()));
        for (final String type : types) {
            builder.addType((DataSetDataType) DataSetDataType.class.getField(type).get(null));
        }
        for (final JsonNode row : value.get("rows")) {
            final Row.RowBuilder cells = new Row.RowBuilder();
            for (int index = 0; index < types.size(); index++) {
                final DataSetDataType type = (DataSetDataType) DataSetDataType.class.getField(types.get(index)).get(null);
                cells.addValue(new Value<>(type, value(type(types.get(index)), row.get(index))));
            }
            builder.addRow(cells.createRow());
        }
        return builder.createDataSet();
    }

    private static Template template(final JsonNode value) throws Exception {
        final Template.TemplateBuilder builder = new Template.TemplateBuilder().version("1");
        builder.definition(value.get("definition").asBoolean()).addMetrics(metrics(value.get("metrics")));
        if (value.hasNonNull("ref")) {
            builder.templateRef(value.get("ref").asText());
        }
        return builder.createTemplate();
    }
}
