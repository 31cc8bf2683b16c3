// Tables with columns by name and unit; errors name the line.
#include "case/csv.hpp"

#include <gtest/gtest.h>

#include "error.hpp"
#include "temporary_directory.hpp"

namespace moraine::cases {
namespace {

const TemporaryDirectory here;
CsvTable table(const std::string& text) { return CsvTable(here.write("t.csv", text)); }

void expect_refused(const std::string& text, const std::string& words, const std::string& column = "x",
                    const std::string& unit = "m") {
  try {
    table(text).column(column, unit);
    ADD_FAILURE() << words;
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find(words), std::string::npos) << e.what();
  }
}

TEST(Csv, ColumnsByNameInSiUnits) {
  const CsvTable t =
      table("\xEF\xBB\xBF# made by hand\n\nx, size (mm) ,finer (%)\r\n 1e-3,2 , 50\n# more\n-4, 0.5,100\n");
  EXPECT_EQ(t.rows(), 2u);
  EXPECT_EQ(t.column("x", "m"), (std::vector<double>{1e-3, -4}));
  const std::vector<double> size = t.column("size", "m"), finer = t.column("finer", "1");
  EXPECT_DOUBLE_EQ(size[0], 2e-3);
  EXPECT_DOUBLE_EQ(size[1], 0.5e-3);
  EXPECT_DOUBLE_EQ(finer[0], 0.5);
  EXPECT_TRUE(t.has("size") && !t.has("Size"));
  EXPECT_TRUE(t.at(1).ends_with("t.csv, line 6"));
}

// A number keeps its bits.
TEST(Csv, NumbersAreExact) {
  EXPECT_EQ(table("x\n0.10000000000000001\n1.7976931348623157e308\n").column("x", "m"),
            (std::vector<double>{0.1, 1.7976931348623157e308}));
}

TEST(Csv, SaysWhatIsWrongAndWhere) {
  expect_refused("", "is empty; expected a line of names");
  expect_refused("x,y\n", "has no rows");
  expect_refused("1,2\n3,4\n", "line 1: \"1\" is no name of a column");
  expect_refused("x,y,x\n1,2,3\n", "line 1: the column x is there twice");
  expect_refused("x,y\n1,2\n3\n", "line 3: 1 values; expected 2, one for each of x, y");
  expect_refused("x,y\n1,2,\n", "line 2: 3 values; expected 2");
  expect_refused("x\n1\n\n2a\n", "line 4: x = \"2a\"; expected a number");
  expect_refused("x\nnan\n", "line 2: x = \"nan\"; expected a number");
  expect_refused("x\n1;2\n", "line 2: x = \"1;2\"; expected a number");
  expect_refused("X\n1\n", "there is no column x; it has X");
  expect_refused("x (s)\n1\n", "x (s): \"s\" has the wrong dimension");
  expect_refused("x (mn)\n1\n", "x (mn):");
}

TEST(Csv, UnknownColumns) {
  EXPECT_NO_THROW(table("x,y\n1,2\n").expect_only({"x", "y", "z"}));
  try {
    table("x,radius\n1,2\n").expect_only({"x", "r"});
    ADD_FAILURE();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("unknown column radius; expected x, r"), std::string::npos)
        << e.what();
  }
}

}  // namespace
}  // namespace moraine::cases
