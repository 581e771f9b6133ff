// A table as data, with its protocol, and its two forms: Markdown and HTML.
#pragma once

#include <cctype>
#include <cstddef>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "html.hpp"

namespace cfp_slam {

enum class Rank { none, best, second };

struct Cell {
  Cell(std::string text_ = {}, std::string range_ = {}, Rank rank_ = Rank::none)
      : text(std::move(text_)), range(std::move(range_)), rank(rank_) {}
  Cell(const char* text_) : text(text_) {}

  std::string text;
  std::string range;  // spread, coverage: beside the figure, less prominent
  Rank rank = Rank::none;
};

struct Table {
  std::string title;
  std::string protocol;  // how the figures came about
  std::vector<std::string> header;
  std::vector<std::vector<Cell>> rows;
  std::string note;           // below
  bool words = false;         // cells hold sentences, not figures
  std::set<std::size_t> own;  // rows to be found at once among those of others
};

// Text in a Markdown table's cell: the pipe and what would be read as mark-up. An underscore inside a word is none.
inline std::string markdown_escape(const std::string& text) {
  std::string out;
  const auto is_word = [&text](std::size_t k) {
    return k < text.size() && std::isalnum(static_cast<unsigned char>(text[k])) != 0;
  };
  for (std::size_t k = 0; k < text.size(); ++k) {
    const char c = text[k];
    const bool underscore = c == '_' && !(k > 0 && is_word(k - 1) && is_word(k + 1));
    if (c == '|' || c == '\\' || c == '`' || c == '*' || underscore || c == '[' || c == ']') out += '\\';
    if (c == '<') {
      out += "&lt;";
    } else if (c == '&') {
      out += "&amp;";
    } else {
      out += c == '\n' || c == '\r' ? ' ' : c;
    }
  }
  return out;
}

inline std::string to_markdown(const Table& table) {
  std::string out = "### " + markdown_escape(table.title) + "\n\n";
  if (!table.protocol.empty()) out += markdown_escape(table.protocol) + "\n\n";
  std::string rule = "|";
  out += '|';
  for (std::size_t c = 0; c < table.header.size(); ++c) {
    out += ' ' + markdown_escape(table.header[c]) + " |";
    rule += c == 0 || table.words ? "---|" : "---:|";
  }
  out += '\n' + rule + '\n';
  for (const auto& row : table.rows) {
    out += '|';
    for (const Cell& cell : row) {
      const char* mark = cell.rank == Rank::best ? "**" : cell.rank == Rank::second ? "*" : "";
      out += ' ' + (mark + markdown_escape(cell.text) + mark) +
             (cell.range.empty() ? "" : " (" + markdown_escape(cell.range) + ')') + " |";
    }
    out += '\n';
  }
  if (!table.note.empty()) out += '\n' + markdown_escape(table.note) + '\n';
  return out + '\n';
}

// The parts of a range below each other: a column no wider than it must be.
inline std::string in_lines(std::string range) {
  for (std::size_t at = range.find("; "); at != std::string::npos; at = range.find("; ", at))
    range.replace(at, 2, "<br/>");
  return range;
}

inline std::string to_html(const Table& table) {
  std::string out = table.title.empty() ? "" : "<h3>" + escape(table.title) + "</h3>\n";
  if (!table.protocol.empty()) out += "<p class=\"note\">" + escape(table.protocol) + "</p>\n";
  out += "<div class=\"scroll\"><table" + std::string(table.words ? " class=\"words\"" : "") + "><thead><tr>";
  for (const std::string& h : table.header) out += "<th>" + escape(h) + "</th>";
  out += "</tr></thead><tbody>\n";
  for (const auto& row : table.rows) {
    out += table.own.count(static_cast<std::size_t>(&row - table.rows.data())) > 0 ? "<tr class=\"own\">" : "<tr>";
    for (std::size_t c = 0; c < row.size(); ++c) {
      const char* mark = row[c].rank == Rank::best ? "b" : row[c].rank == Rank::second ? "u" : "span";
      out += std::string(c == 0 ? "<th scope=\"row\">" : "<td>") + '<' + mark + '>' + escape(row[c].text) + "</" +
             mark + '>' +
             (row[c].range.empty() ? "" : "<br/><span class=\"range\">" + in_lines(escape(row[c].range)) + "</span>") +
             (c == 0 ? "</th>" : "</td>");
    }
    out += "</tr>\n";
  }
  out += "</tbody></table></div>\n";
  if (!table.note.empty()) out += "<p class=\"note\">" + escape(table.note) + "</p>\n";
  return out;
}

}  // namespace cfp_slam
